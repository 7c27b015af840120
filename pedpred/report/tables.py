"""Pivots of the table of results: which figures are rows and columns, and how a figure is written."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import pandas as pd

from pedpred.metrics import METRICS
from pedpred.metrics.calibration import REGIONS, shown_steps
from pedpred.report.document import NOTHING, Cell, Row, Table, Whisker
from pedpred.report.findings import Finding
from pedpred.report.methods import Methods
from pedpred.report.results import ADE_GAP, STEPS, Figures, Result, figure_of

FIRST = (
    *("ade_m", "fde_m", "min_ade_m_k6", "moving_ade_m", "nll"),
    *("obstacle_share", "collision_share", "mode_collision_share"),
)
"""Metrics of the first table; all others follow in a second one."""
_OUTLIER = 1.6
"""A method whose error ends this much above all others' does not set the scale."""


def pivot(
    frame: pd.DataFrame,
    keys: Sequence[str],
    rows: Iterable[Hashable],
    columns: Iterable[Hashable],
    cell: Callable[[Any], Cell],
    empty: str = NOTHING,
) -> list[list[Cell]]:
    """Arrange figures in a table.

    Args:
        frame: rows of the table of results.
        keys: column of the frame whose values are the rows of the table, and the one for its columns.
        rows: values of the first, in their order.
        columns: of the second.
        cell: writes a row of the frame.
        empty: text of a cell without a figure.
    """
    own = frame.drop_duplicates(list(keys))
    found = dict(zip(own[list(keys)].itertuples(index=False, name=None), own.itertuples(), strict=True))
    columns = list(columns)
    return [[cell(found[r, c]) if (r, c) in found else Cell(empty) for c in columns] for r in rows]


def study_cell(row: Any) -> Cell:
    """Write a figure of several studies of a place, followed by its interval."""
    (value, bounds), unit = figure_of(row), METRICS[row.figure].unit
    scale, digits = (100.0, 2) if unit == "%" else (1.0, 3)
    text = f"{scale * value:.2f} %" if unit == "%" else f"{value:.{2 if unit == 'nats' else 3}f}"
    words = interval([scale * end for end in bounds], digits=digits) if bounds else ""
    return Cell(text, f"{row.study}.{row.place}.{row.method}.{row.figure}", words, unit)


def metric_cell(row: Any) -> Cell:
    """Write a figure; its interval is a tooltip, and stands behind a paired difference to the reference."""
    address = f"{row.place}.{row.method}.{row.figure}"
    if row.figure == ADE_GAP:
        value, bounds = figure_of(row)
        words = interval(bounds, "+") if bounds else ""
        return Cell(f"{value:+.3f}", address, words, remark="paired difference")
    cell = study_cell(row)
    return Cell(cell.text, address, remark=cell.tip)


def interval(bounds: Sequence[float], sign: str = "", digits: int = 3) -> str:
    """Two ends of an interval, e.g. `0.371 to 0.392`."""
    return f"{bounds[0]:{sign}.{digits}f} to {bounds[1]:{sign}.{digits}f}"


def metric_title(key: str) -> str:
    """Label and unit of a metric, as in a header."""
    metric = METRICS[key]
    return metric.label if metric.unit == "%" else f"{metric.label} [{metric.unit}]"


def metric_keys(figures: Figures) -> tuple[list[str], list[str]]:
    """Metrics of the first and of the second table.

    A metric that no method has is left out, and so is one that repeats an earlier one for all methods, as
    the best of several modes does where every method has just one.
    """
    values = figures.frame[figures.frame["step"] == 0].pivot(index="method", columns="figure", values="value")
    shown: list[str] = []
    for key in dict.fromkeys([*FIRST, *METRICS]):
        if key in values and not any(values[key].equals(values[other]) for other in shown):
            shown.append(key)
    return [key for key in shown if key in FIRST], [key for key in shown if key not in FIRST]


def _with_gaps(frame: pd.DataFrame, methods: Methods) -> pd.DataFrame:
    """Drop differences without an interval, and those of the reference method to itself."""
    useless = (frame["method"] == methods.reference.key) | frame["low"].isna()
    return frame[~(useless & (frame["figure"] == ADE_GAP))]


def metrics_table(result: Result, methods: Methods) -> Table:
    """The first metrics of a test set, a row per method."""
    figures, marks, keys = result.figures, whiskers(result.figures), metric_keys(result.figures)[0]
    names, frame = methods.ordered(figures.methods), _with_gaps(figures.frame, methods)
    cells = pivot(frame, ["method", "figure"], names, [*keys, ADE_GAP], metric_cell)
    rows = []
    for name, own in zip(names, cells, strict=True):
        size = f"{figures.value(name, 'windows'):.0f} windows of {figures.value(name, 'tracks'):.0f} tracks"
        bounds = interval(figures.ade_bounds(name))
        own[0] = replace(own[0], bounds=bounds, remark=size, whisker=marks[name])
        rows.append(method_row(name, own, methods))
    gap_title = f"ADE minus {methods.reference.label} [m]"
    return Table(["method", *map(metric_title, keys), gap_title], rows)


def whiskers(figures: Figures) -> dict[str, Whisker]:
    """The ADE of each method with its interval, on the scale that all but outliers share."""
    bounds = {name: figures.ade_bounds(name) for name in figures.methods}
    top, _ = scale_of({name: high for name, (_, high) in bounds.items()})
    ends = {name: (low, figures.value(name), high) for name, (low, high) in bounds.items()}
    return {n: Whisker(*(100.0 * end / top for end in own), beyond=own[0] > top) for n, own in ends.items()}


def scale_of(ends: Mapping[str, float]) -> tuple[float, str | None]:
    """Upper end of an axis for these ends, and the method that is far beyond all others, if there is one.

    Above exact forecasts nothing is far beyond; if all are exact, the axis ends at 1.
    """
    by_size = sorted(ends, key=ends.__getitem__)
    if len(by_size) > 1 and ends[by_size[-2]] and ends[by_size[-1]] > _OUTLIER * ends[by_size[-2]]:
        return 1.15 * ends[by_size[-2]], by_size[-1]
    return 1.08 * ends[by_size[-1]] or 1.0, None


def further_table(result: Result, methods: Methods) -> Table:
    """All other metrics of a test set, a row per method that has some."""
    keys = metric_keys(result.figures)[1]
    frame = result.figures.frame[result.figures.frame["figure"].isin(keys)]
    names = methods.ordered(frame["method"])
    cells = pivot(frame, ["method", "figure"], names, keys, metric_cell)
    rows = [method_row(name, own, methods) for name, own in zip(names, cells, strict=True)]
    return Table(["method", *map(metric_title, keys)], rows)


def scenes_table(result: Result, methods: Methods) -> Table:
    """ADE of every method in every scene of a test set, a row per scene."""
    main, frame = methods.main, pd.concat([own.frame for own in result.parts.values()])
    frame, names = _with_gaps(frame, methods), methods.ordered(frame["method"])
    windows = frame[frame["figure"] == "windows"].groupby("place")["value"].max()
    places = [f"{result.name}_{scene}" for scene in result.parts]
    errors = pivot(frame[frame["figure"] == "ade_m"], ["place", "method"], places, names, metric_cell)
    gaps = pivot(frame[frame["method"] == main.key], ["place", "figure"], places, [ADE_GAP], metric_cell)
    rows = [
        Row([Cell(scene), Cell(f"{windows[place]:.0f}"), *own, *gap])
        for scene, place, own, gap in zip(result.parts, places, errors, gaps, strict=True)
    ]
    gap_title = f"{main.label} minus {methods.reference.label}"
    return Table(["scene", "windows", *(methods[name].label for name in names), gap_title], rows)


def steps_table(result: Result, methods: Methods) -> Table:
    """Mean and quartiles of the error over the horizon, a row per method."""
    columns, rows = [result.figures.over_steps(key) for key in STEPS], []
    for name in methods.ordered(result.figures.methods):
        values = zip(*(column[name] for column in columns), strict=True)
        texts = [f"{mean:.3f} ({low:.3f}, {median:.3f}, {high:.3f})" for mean, low, median, high in values]
        rows.append(method_row(name, map(Cell, texts), methods))
    return Table(["method", *(f"{step * result.dt_s:.1f} s" for step in columns[0].index)], rows)


def calibration_table(result: Result, methods: Methods) -> Table | None:
    """Coverage and NLL at `shown_steps`, a row per method with covariances; None if there is none."""
    nll = result.figures.over_steps("per_step_nll")
    if nll.empty:
        return None
    steps = [step + 1 for step in shown_steps(len(nll))]
    times = " / ".join(f"{step * result.dt_s:.1f}" for step in steps)
    held = [result.figures.over_steps(f"per_step_coverage_{100 * share:.0f}") for share in REGIONS]
    rows = []
    for name in methods.ordered(nll.columns):
        cells = [" / ".join(f"{100.0 * shares[name][step]:.0f}" for step in steps) for shares in held]
        cells.append(" / ".join(f"{nll[name][step]:.2f}" for step in steps))
        rows.append(method_row(name, map(Cell, cells), methods))
    regions = [f"in the {100 * share:.0f} % region [%]" for share in REGIONS]
    return Table([f"after {times} s", *regions, "NLL [nats]"], rows)


def findings_table(findings: Sequence[tuple[str, Finding]]) -> Table:
    """Expectations, the figures that decide, and the decision."""
    rows = [Row([*map(Cell, (name, f.claim, f.measured, f.verdict))]) for name, f in findings]
    return Table(["where", "expected", "measured", "verdict"], rows, texts=4)


def method_row(name: str, cells: Iterable[Cell], methods: Methods) -> Row:
    """A row about a method, which begins with its label."""
    return Row([Cell(methods[name].label), *cells], name, name == methods.main.key)
