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
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from pedpred.config import config_errors, plain, read_params
from pedpred.files import write_text
from pedpred.report.document import NOTHING, Cell, Row, Table
from pedpred.report.literature import literature_tables, read_published
from pedpred.report.methods import Method, Methods
from pedpred.report.results import figure_of, metrics_now, read_metrics, results_frame
from pedpred.report.tables import pivot

_MARKED = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
_TRAININGS = {"transfer": "simulation only", "real": "fine-tuned on the other places"}
_MOST_COLUMNS = 6


def filled(text: str, tables: Mapping[str, str]) -> str:
    """Replace what stands between the marks of tables; those of other names, or without figures, stay."""

    def written(mark: re.Match[str]) -> str:
        table = tables.get(mark[2])
        return f"{mark[1]}{table}\n{mark[3]}" if table else mark[0]

    return _MARKED.sub(written, text)


def tables_from(studies: Mapping[str, Any], methods: Methods) -> dict[str, str]:
    """Return name of a table -> Markdown; `studies`: "transfer" and "real" -> metrics."""
    frame, places = results_frame(studies), list(studies["real"])
    main = [m for m in methods.networks if all(m.key in own for own in studies["real"].values())][-1]
    lines = {  # a network has one for each training
        (method.key, study): f"{method.label}, {training}" if method.role == "network" else method.label
        for method in methods
        for study, training in _TRAININGS.items()
        if method.role == "network" or (method.role != "ablation" and study == "real")
    }
    errors = frame[frame["figure"] == "ade_m"].copy()
    errors["line"] = [lines.get(pair) for pair in zip(errors["method"], errors["study"], strict=True)]
    errors = errors.dropna(subset="line")
    ranked = errors[[methods[key].role != "oracle" for key in errors["method"]]]
    best = ranked.groupby("place")["value"].min()

    def error_cell(row: Any) -> Cell:
        return replace(_error(row), strong=row.value == best[row.place])

    def table(keys: tuple[str, str], rows: Sequence[str], columns: Sequence[str]) -> str:
        cells = pivot(errors, keys, rows, columns, error_cell, empty="")
        body = [Row([Cell(_words(row)), *own]) for row, own in zip(rows, cells, strict=True)]
        return Table(["ADE over 3 s, m", *map(_words, columns)], body).markdown("")

    every = [line for line in lines.values() if line in set(errors["line"])]
    chosen = [(method.key, "real") for method in (*methods.simple, methods.networks[0], main)]
    few = [lines[pair] for pair in lines if pair in [*chosen, (main.key, "transfer")]]
    blocks = [places[k : k + _MOST_COLUMNS] for k in range(0, len(places), _MOST_COLUMNS)]
    return {
        "headline": _headline(errors[errors["study"] == "real"], main, methods),
        "unseen": "\n\n".join(table(("line", "place"), every, block) for block in blocks),
        "places": table(("place", "line"), places, [line for line in few if line in every]),
        "main": _main_table(frame[frame["method"] == main.key], places, main),
    }


def _headline(errors: pd.DataFrame, main: Method, methods: Methods) -> str:
    """Say how far the main method is from the best simple one at every unseen place."""
    simple = errors[errors["method"].isin([method.key for method in methods.simple])]
    least, own = simple.groupby("place")["value"].min(), errors[errors["method"] == main.key]
    parts = [
        f"{_words(row.place)} {100 * (row.value / least[row.place] - 1):+.0f} %"
        for row in own.itertuples()
        if least.get(row.place)  # nothing relates to an exact forecast
    ]
    return f"Error of {main.label} relative to {methods.best_simple}: {', '.join(parts)}."


def _main_table(figures: pd.DataFrame, places: Sequence[str], main: Method) -> str:
    """Make the table of the main method at every unseen place; of figures over the horizon, the last one."""
    columns = {
        "windows": ("windows", lambda row: Cell(f"{row.value:.0f}")),
        "ade_m": ("ADE, m", _error),
        "fde_m": ("FDE, m", _error),
        "min_ade_m_k6": ("ADE of the best of 6 modes, m", lambda row: Cell(f"{row.value:.3f}")),
        "nll": ("NLL, nats", lambda row: Cell(f"{row.value:.3f}")),
        "per_step_coverage_90": ("90 % region holds at 3 s", lambda row: Cell(f"{100 * row.value:.0f} %")),
    }
    last = figures.sort_values("step", ascending=False, kind="stable")
    last = last.assign(line=list(zip(last["place"], last["study"], strict=True)))
    lines = [(place, study) for place in places for study in _TRAININGS]
    lines = [line for line in lines if line in set(last["line"])]
    cells = pivot(last, ("line", "figure"), lines, columns, lambda row: columns[row.figure][1](row))
    body = [
        Row([Cell(_words(place)), Cell(_TRAININGS[study]), *own])
        for (place, study), own in zip(lines, cells, strict=True)
    ]
    titles = [title for title, _ in columns.values()]
    return Table([f"{main.label}, unseen place", "training", *titles], body).markdown("")


def _error(row: Any) -> Cell:
    value, bounds = figure_of(row)
    return Cell(f"{value:.3f}", bounds=f"{bounds[0]:.3f}-{bounds[1]:.3f}" if bounds else "")


def _words(place: str) -> str:
    return place.replace("_", " ")


def pages(root: Path) -> dict[Path, str]:
    """Return the pages with marks and their up-to-date text; none where a tested place has no figures.

    Raises:
        InputError: a metric file is missing or damaged.
    """
    params = plain(read_params(root))
    studies = {study: read_metrics(root / f"reports/metrics/{study}.json") for study in _TRAININGS}
    if without := lacking(params["folds"], studies):
        logging.warning("the tables stay as they are: there are no figures of %s", ", ".join(without))
        return {}
    methods = Methods.read(root, params["comparison"]["reference"])
    tables = tables_from(studies, methods)
    if literature := metrics_now(root / "reports/metrics").get("literature"):
        frame, published = results_frame({"literature": literature}), read_published(root)
        beside = literature_tables(frame, published, methods)
        means = mean_errors(beside["literature_one"], beside["literature_best"])
        tables["literature"] = means.markdown("")
    files = [root / "README.md", *sorted((root / "docs").rglob("*.md"))]
    return {path: filled(text, tables) for path in files if _MARKED.search(text := path.read_text())}


def mean_errors(one: Table, best: Table) -> Table:
    """Join the mean errors, columns 1 and 2, of one forecast and of the best of 20; a row per method."""
    errors: dict[str, list[Cell]] = {}
    for column, table in ((0, one), (2, best)):
        for name, *means in (row.cells[:3] for row in table.rows):
            cells = errors.setdefault(name.text, [Cell(NOTHING)] * 4)
            cells[column : column + 2] = means
    body = [
        Row([Cell(name), *cells])
        for name, cells in errors.items()
        if any(cell.text != NOTHING for cell in cells)
    ]
    titles = [f"{figure}, {which}" for which in ("one forecast", "best of 20") for figure in ("ADE", "FDE")]
    return Table(["mean error of the five scenes, m", *titles], body)


def lacking(folds: Mapping[str, Any], studies: Mapping[str, Any]) -> list[str]:
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
