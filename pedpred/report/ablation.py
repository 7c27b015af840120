"""Ablations: settings of a file under `conf/ablations`, and its points as picture and table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from pedpred.errors import InputError, ValueRuleError
from pedpred.files import read_yaml, translate_errors
from pedpred.plain import parse_json
from pedpred.report.canvas import blank, styled
from pedpred.report.document import NOTHING, Picture, Pictures, Section, markdown_table
from pedpred.report.methods import Methods
from pedpred.report.tables import interval
from pedpred.settings import load

_SPREAD = "mean ± standard deviation"


@dataclass(frozen=True)
class Column:
    """A further figure of an ablation's last method, for its table."""

    metrics: str  # file that a target writes
    entry: str  # in this file, such as a test set
    figure: str = "ade_m"  # of this entry
    over: str = ""  # divided by this method's


@dataclass(frozen=True)
class Ablation:
    """Experiments that differ in one respect.

    A file may name another one as its `base`, whose `always` comes first. `columns` are further figures by
    title. `curves` are training curves to compare, method -> file that a stage before a target writes; the
    steps to reach `within` times the first point's best validation error are reported.
    """

    title: str  # of picture and table
    axis: str  # quantity of the points; empty when their names are not numbers
    targets: Sequence[str]  # stages of the pipeline that are reproduced
    metrics: str  # file that a target writes
    entry: str  # in this file, such as a test set
    methods: Sequence[str]  # compared in every point
    references: Sequence[str]  # methods that no point changes, shown for scale
    always: Sequence[str]  # overrides of every point
    points: Mapping[str, Sequence[str]]  # further overrides by the name of the point
    repeated: bool = False  # the points differ in their seeds alone, so their mean and spread are reported
    columns: Mapping[str, Column] = field(default_factory=dict)
    curves: Mapping[str, str] = field(default_factory=dict)
    within: Sequence[float] = ()

    @property
    def has_spread(self) -> bool:
        """Whether mean and spread of the points are reported: they differ in seeds, and one has no spread."""
        return self.repeated and len(self.points) > 1


def read_ablation(path: Path) -> Ablation:
    """Read `conf/ablations/<name>.yaml`.

    Raises:
        ValueRuleError: there is no such file.
        InputError: it is damaged, or a key is missing or unknown.
    """
    if not path.is_file():
        known = sorted(other.stem for other in path.parent.glob("*.yaml"))
        raise ValueRuleError("ablation", path.stem, f"known ablations are {known}")
    wording = partial(InputError, path, "", remedy="Correct it")
    plain = read_yaml(path, wording)
    with translate_errors(wording):
        if "base" in plain:
            plain["always"] = [
                *read_ablation(path.with_stem(plain.pop("base"))).always,
                *plain.get("always", []),
            ]
        points = {str(name): overrides for name, overrides in plain.pop("points").items()}
        ablation: Ablation = load(Ablation, plain | {"points": points})
        return ablation


def ablation_sections(asked: Path, results: Path, methods: Methods) -> list[Section]:
    """A picture per ablation that was run: `asked`/<name>.yaml and the rows in `found`/<name>.json."""
    sections = []
    for path in sorted(results.glob("*.json")):
        ablation = read_ablation(asked / f"{path.stem}.yaml")
        figure = ablation_figure(ablation, parse_json(path.read_text()), methods)
        caption = f"Made by python -m tools.ablate {path.stem}; bars: 95 % intervals over tracks."
        sections.append(Section(ablation.title, [Pictures([Picture(path.stem, caption, figure)])]))
    return sections


def point_rows(ablation: Ablation, measured: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row per point and method, its error and the interval; `columns` with the last method.

    Args:
        ablation: see there.
        measured: contents of the metric files: {point: {file: {entry: {method: figures}}}}.
    """
    rows = []
    for name, files in measured.items():
        methods = files[ablation.metrics][ablation.entry]
        for method in (*ablation.references, *ablation.methods):
            row = {"point": name, "overrides": [*ablation.always, *ablation.points[name]], "method": method}
            rows.append(row | {key: methods[method][key] for key in ("ade_m", "ade_m_ci95")})
        if ablation.columns:
            columns = {t: _figure(c, ablation.methods[-1], files) for t, c in ablation.columns.items()}
            rows[-1]["columns"] = columns
    return rows


def _figure(column: Column, method: str, files: Mapping[str, Any]) -> float | None:
    """A figure; None where it was not measured, as at a place without a recording."""
    methods = files[column.metrics].get(column.entry, {})
    value, over = (methods.get(key, {}).get(column.figure) for key in (method, column.over))
    if value is None or (column.over and not over):
        return None
    return float(value / over if column.over else value)


@styled
def ablation_figure(ablation: Ablation, rows: Sequence[Mapping[str, Any]], methods: Methods) -> Figure:
    """Draw the error of every method over the points, with its 95 % interval."""
    figure = blank(6.0, 3.4 if ablation.axis else 1.2 + 0.3 * len(ablation.points))
    axes = figure.subplots()
    error = f"ADE in {ablation.entry} [m]"
    places = {name: float(name) if ablation.axis else k for k, name in enumerate(ablation.points)}
    for method in map(methods.__getitem__, (*ablation.references, *ablation.methods)):
        mine = [row for row in rows if row["method"] == method.key]
        place, ade = [places[row["point"]] for row in mine], [row["ade_m"] for row in mine]
        spread = np.abs(np.array([row["ade_m_ci95"] for row in mine]).T - ade)
        style: dict[str, Any] = {"color": method.colour, "label": method.label, "capsize": 2}
        if ablation.axis:
            axes.errorbar(place, ade, yerr=spread, fmt="o-", **style)
        else:
            axes.errorbar(ade, place, xerr=spread, fmt="o", **style)
    if ablation.axis:
        axes.set(xscale="log", xlabel=ablation.axis, ylabel=error, ylim=(0, None))
        axes.set_xticks(list(places.values()), list(places), minor=False)
        axes.set_xticks([], minor=True)
    else:
        axes.set(xlabel=error, xlim=(0, None))
        axes.set_yticks(list(places.values()), list(places))
        axes.invert_yaxis()
    figure.suptitle(ablation.title, x=0.01, ha="left", fontsize="medium")
    figure.legend(loc="outside lower left", ncols=4)
    return figure


def ablation_table(ablation: Ablation, rows: Sequence[Mapping[str, Any]], methods: Methods) -> str:
    """Write a Markdown table, a row per point; then one of the columns, if there are any."""
    own = {(row["point"], row["method"]): row for row in rows}
    errors = {
        methods[key].label: [
            (own[name, key]["ade_m"], f" ({interval(own[name, key]['ade_m_ci95'])})")
            for name in ablation.points
        ]
        for key in (*ablation.references, *ablation.methods)
    }
    tables = [_points_table(ablation, ablation.axis or "point", errors)]
    if ablation.columns:
        found = {row["point"]: row["columns"] for row in rows if "columns" in row}
        columns = {key: [(found[name][key], "") for name in ablation.points] for key in ablation.columns}
        tables.append(_points_table(ablation, methods[ablation.methods[-1]].label, columns))
    return "\n\n".join(tables)


def _points_table(
    ablation: Ablation, title: str, columns: Mapping[str, Sequence[tuple[float | None, str]]]
) -> str:
    """Figures and words behind them, a row per point; then the mean and spread of repeated ones."""
    texts = [[NOTHING if v is None else f"{v:.3f}{words}" for v, words in each] for each in columns.values()]
    body = [[name, *row] for name, row in zip(ablation.points, zip(*texts, strict=True), strict=True)]
    if ablation.has_spread:
        every = [[value for value, _ in each if value is not None] for each in columns.values()]
        body.append([_SPREAD, *(_spread(own) if len(own) == len(body) else NOTHING for own in every)])
    return markdown_table([title, *columns], body)


def _spread(values: Sequence[float]) -> str:
    return f"{np.mean(values):.3f} ± {np.std(values, ddof=1):.3f}"


def steps_until(
    ablation: Ablation, curves: Mapping[str, Mapping[str, pd.DataFrame]]
) -> dict[str, dict[float, dict[str, int | None]]]:
    """Find the steps to reach each validation error: method -> level, m -> point -> steps.

    The levels are `within` times the first point's best error; None where a point did not get there. Curves
    (see `read_curve`) come as point -> method -> curve.
    """
    needed: dict[str, dict[float, dict[str, int | None]]] = {}
    for method in ablation.curves:
        errors = {point: curves[point][method] for point in ablation.points}
        best_m = float(next(iter(errors.values()))["validation_ade_m"].min())
        levels_m = [factor * best_m for factor in ablation.within]
        needed[method] = {level: {p: _first_step(c, level) for p, c in errors.items()} for level in levels_m}
    return needed


def _first_step(curve: pd.DataFrame, level_m: float) -> int | None:
    there = curve[curve["validation_ade_m"] <= level_m]
    return int(there["step"].iloc[0]) if len(there) else None


def steps_table(
    ablation: Ablation, needed: Mapping[str, Mapping[float, Mapping[str, int | None]]], methods: Methods
) -> str:
    """Write a Markdown table of `steps_until`, a row per point."""
    columns = [
        (f"{methods[m].label} to {level_m:.3f} m", by_point)
        for m in needed
        for level_m, by_point in needed[m].items()
    ]
    body = [
        [name, *("never" if steps[name] is None else str(steps[name]) for _, steps in columns)]
        for name in ablation.points
    ]
    return markdown_table(["steps until validation", *(title for title, _ in columns)], body)
