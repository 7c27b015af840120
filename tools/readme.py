"""Write the tables of results into README.md and docs/: `python -m tools.readme [--check]`.

A table stands between `<!-- table: NAME -->` and `<!-- end -->`. Its figures come from
reports/metrics/{transfer,real}.json; while a place has none, all tables stay as they are. Those beside the
literature come from reports/metrics/literature.json.
"""

from __future__ import annotations

import argparse
import logging
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from pedpred.config import config_errors, plain, read_params
from pedpred.errors import InputError
from pedpred.files import read_json, write_text
from pedpred.report.comparison import metrics_now
from pedpred.report.document import markdown_table
from pedpred.report.literature import literature_tables
from pedpred.report.methods import Method, Methods

Figures = Mapping[str, Mapping[str, Mapping[str, Any]]]
"""Place -> method -> metrics, as in reports/metrics."""

_MARKED = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
_TRAININGS = {"transfer": "simulation only", "real": "fine-tuned on the other places"}
_METRICS = Path("reports/metrics")
_NOT_RANKED = "oracle"
_MOST_COLUMNS = 6


def filled(text: str, tables: Mapping[str, str]) -> str:
    """Replace what stands between the marks of tables; those of other names, or without figures, stay."""

    def written(mark: re.Match[str]) -> str:
        table = tables.get(mark[2])
        return f"{mark[1]}{table}\n{mark[3]}" if table else mark[0]

    return _MARKED.sub(written, text)


def tables_from(studies: Mapping[str, Figures], methods: Methods) -> dict[str, str]:
    """Return name of a table -> Markdown; `studies`: "transfer" and "real" -> figures."""
    return {
        "headline": headline(studies, methods),
        "unseen": unseen_table(studies, methods),
        "places": places_table(studies, methods),
        "main": main_table(studies, methods),
    }


def unseen_table(studies: Mapping[str, Figures], methods: Methods) -> str:
    """Make the tables of errors at unseen places: a row per method and training, a column per place."""
    rows = list(_rows(studies, methods))
    best, every, tables = _lowest(studies, rows), list(studies["real"]), []
    for first in range(0, len(every), _MOST_COLUMNS):
        places = every[first : first + _MOST_COLUMNS]
        body = [[label, *(_cell(metrics, place, best) for place in places)] for label, _, metrics in rows]
        tables.append(markdown_table(["ADE over 3 s, m", *map(_words, places)], body))
    return "\n\n".join(tables)


def places_table(studies: Mapping[str, Figures], methods: Methods) -> str:
    """Make the short table of errors at unseen places: simple methods, the first and the main network."""
    rows = list(_rows(studies, methods))
    best, main = _lowest(studies, rows), _main(studies, methods).label
    shown = [row.label for row in methods.simple]
    shown += [f"{label}, {_TRAININGS['real']}" for label in (methods.networks[0].label, main)]
    shown.append(f"{main}, {_TRAININGS['transfer']}")
    columns = {label: metrics for label, _, metrics in rows if label in shown}
    body = [
        [_words(place), *(_cell(metrics, place, best) for metrics in columns.values())]
        for place in studies["real"]
    ]
    return markdown_table(["ADE over 3 s, m", *columns], body)


def _cell(metrics: Mapping[str, Any], place: str, best: Mapping[str, float]) -> str:
    """Return a method's error at a place, strong if it is the lowest; empty where it was not measured."""
    return _error(metrics[place], metrics[place]["ade_m"] == best[place]) if place in metrics else ""


def _lowest(studies: Mapping[str, Figures], rows: Sequence[tuple[str, str, Any]]) -> dict[str, float]:
    """Return the lowest error at each place of a method that does not know the future."""
    ranked = [metrics for _, role, metrics in rows if role != _NOT_RANKED]
    return {p: min(metrics[p]["ade_m"] for metrics in ranked if p in metrics) for p in studies["real"]}


def headline(studies: Mapping[str, Figures], methods: Methods) -> str:
    """Say how far the main method is from the best simple one at every unseen place."""
    main = _main(studies, methods)
    parts = []
    for place, metrics in studies["real"].items():
        simple = min((metrics[row.key]["ade_m"] for row in methods.simple if row.key in metrics), default=0.0)
        if not simple:  # nothing relates to an exact forecast
            continue
        parts.append(f"{_words(place)} {100 * (metrics[main.key]['ade_m'] / simple - 1):+.0f} %")
    return f"Error of {main.label} relative to {methods.best_simple}: {', '.join(parts)}."


def main_table(studies: Mapping[str, Figures], methods: Methods) -> str:
    """Make the table of the main method at every unseen place."""
    main = _main(studies, methods)
    titles = ["ADE, m", "FDE, m", "ADE of the best of 6 modes, m", "NLL, nats", "90 % region holds at 3 s"]
    body = []
    for place in studies["real"]:
        for study, training in _TRAININGS.items():
            metrics = studies[study].get(place, {}).get(main.key)
            if metrics is None:
                continue
            held = metrics.get("per_step_coverage_90")
            cells = [
                _error(metrics),
                _error(metrics, key="fde_m"),
                _plain(metrics, "min_ade_m_k6"),
                _plain(metrics, "nll"),
            ]
            cells.append(f"{100 * held[-1]:.0f} %" if held else "-")
            body.append([_words(place), training, str(metrics["windows"]), *cells])
    return markdown_table([f"{main.label}, unseen place", "training", "windows", *titles], body)


def _main(studies: Mapping[str, Figures], methods: Methods) -> Method:
    """Return the last network that has figures at every place."""
    has = [row for row in methods.networks if all(row.key in metrics for metrics in studies["real"].values())]
    return has[-1]


def _rows(studies: Mapping[str, Figures], methods: Methods) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    """Yield label, role and figures by place; a network has a row per training."""
    for method in methods:
        if method.role == "ablation":
            continue
        trained = method.role == "network"
        for study, training in _TRAININGS.items():
            metrics = {p: known[method.key] for p, known in studies[study].items() if method.key in known}
            if metrics and (trained or study == "real"):
                yield f"{method.label}, {training}" if trained else method.label, method.role, metrics


def _error(metrics: Mapping[str, Any], best: bool = False, key: str = "ade_m") -> str:
    low, high = metrics[f"{key}_ci95"]
    value = f"**{metrics[key]:.3f}**" if best else f"{metrics[key]:.3f}"
    return f"{value} ({low:.3f}-{high:.3f})"


def _plain(metrics: Mapping[str, Any], key: str) -> str:
    return f"{metrics[key]:.3f}" if metrics.get(key) is not None else "-"


def _words(place: str) -> str:
    return place.replace("_", " ")


def pages(root: Path) -> dict[Path, str]:
    """Return the pages with marks and their up-to-date text; none where a tested place has no figures.

    Raises:
        InputError: a metric file is missing or damaged.
    """
    params = plain(read_params(root))
    studies = {}
    for study in _TRAININGS:
        path = root / _METRICS / f"{study}.json"
        studies[study] = read_json(path, partial(InputError, path, "metrics"))
    if without := lacking(params["folds"], studies):
        logging.warning("the tables stay as they are: there are no figures of %s", ", ".join(without))
        return {}
    methods = Methods.parse(params["report"]["methods"], params["comparison"]["reference"])
    literature = metrics_now(root / _METRICS).get("literature", {})
    ours_and_theirs = (
        literature_tables(literature, params["report"]["published"], methods) if literature else {}
    )
    tables = tables_from(studies, methods)
    tables |= {name: table.markdown("") for name, table in ours_and_theirs.items()}
    files = [root / "README.md", *sorted((root / "docs").rglob("*.md"))]
    return {path: filled(text, tables) for path in files if _MARKED.search(text := path.read_text())}


def lacking(folds: Mapping[str, Any], studies: Mapping[str, Figures]) -> list[str]:
    """Name the places that are tested but have no figures, as where their recordings are missing."""
    tested = [(study, entry) for study in studies for fold in folds[study].values() for entry in fold["test"]]
    places = [(study, entry.split("/")[1]) for study, entry in tested]
    return list(dict.fromkeys(place for study, place in places if place not in studies[study]))


@config_errors()
def main() -> None:
    """Write the tables, or fail when some are out of date."""
    parser = argparse.ArgumentParser(prog="python -m tools.readme", description=__doc__.partition(":")[0])
    parser.add_argument(
        "--check", action="store_true", help="write nothing, fail when a table is out of date"
    )
    check = parser.parse_args().check
    stale = {path: text for path, text in pages(Path()).items() if path.read_text() != text}
    if check and stale:
        raise SystemExit(f"run `make readme`: out of date are {', '.join(map(str, stale))}")
    for path, text in stale.items():
        write_text(path, text)
        sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    main()
