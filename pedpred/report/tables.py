"""Tables of metrics. Which columns there are follows from `METRICS` and from what was measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from pedpred.metrics import METRICS
from pedpred.metrics.calibration import REGIONS, shown_steps
from pedpred.report.charts import whiskers
from pedpred.report.document import NOTHING, Cell, Row, Table
from pedpred.report.findings import Finding
from pedpred.report.measures import Figures, Result, bounds_of
from pedpred.report.methods import Methods

FIRST = (
    *("ade_m", "fde_m", "min_ade_m_k6", "moving_ade_m", "nll"),
    *("obstacle_share", "collision_share", "mode_collision_share"),
)
"""Metrics of the first table; all others follow in a second one."""
_GAP = "ade_m_minus_reference"


def metric_keys(figures: Figures) -> tuple[list[str], list[str]]:
    """Metrics of the first and of the second table.

    A metric that no method has is left out, and so is one that repeats an earlier one for all methods, as
    the best of several modes does where every method has just one.
    """
    shown: dict[str, list[Any]] = {}
    for key in [*FIRST, *METRICS]:
        column = [metrics.get(key) for metrics in figures.values()]
        if any(value is not None for value in column) and column not in shown.values():
            shown[key] = column
    return [key for key in shown if key in FIRST], [key for key in shown if key not in FIRST]


def metrics_table(result: Result, methods: Methods) -> Table:
    """The first metrics of a test set, a row per method."""
    keys, marks = metric_keys(result.figures)[0], whiskers(result.figures)
    header = ["method", *map(metric_title, keys), f"ADE minus {methods.reference.label} [m]"]
    rows = []
    for name in methods.ordered(result.figures):
        metrics = result.figures[name]
        size = f"{metrics['windows']} windows of {metrics['tracks']} tracks"
        cells = [metric_cell(result.name, name, key, metrics) for key in keys]
        bounds = interval(metrics["ade_m_ci95"])
        cells[0] = replace(cells[0], bounds=bounds, remark=size, whisker=marks[name])
        cells.append(gap_cell(result.name, name, metrics, methods))
        rows.append(_row(name, cells, methods))
    return Table(header, rows)


def further_table(result: Result, methods: Methods) -> Table:
    """All other metrics of a test set, a row per method."""
    keys = metric_keys(result.figures)[1]
    rows = [
        _row(name, [metric_cell(result.name, name, key, result.figures[name]) for key in keys], methods)
        for name in methods.ordered(result.figures)
        if any(key in result.figures[name] for key in keys)
    ]
    return Table(["method", *map(metric_title, keys)], rows)


def scenes_table(result: Result, methods: Methods) -> Table:
    """ADE of every method in every scene of a test set, a row per scene."""
    names = methods.ordered({name for figures in result.parts.values() for name in figures})
    main = methods.main
    rows = []
    for scene, figures in result.parts.items():
        place, metrics = f"{result.name}_{scene}", figures.get(main.key, {})
        windows = max(each["windows"] for each in figures.values())
        errors = [metric_cell(place, name, "ade_m", figures.get(name, {})) for name in names]
        last = gap_cell(place, main.key, metrics, methods)
        rows.append(Row([Cell(scene), Cell(str(windows)), *errors, last]))
    gap = f"{main.label} minus {methods.reference.label}"
    return Table(["scene", "windows", *(methods[name].label for name in names), gap], rows)


def calibration_table(result: Result, methods: Methods) -> Table | None:
    """Coverage and NLL at `shown_steps`, a row per method with covariances; None if there is none."""
    names = [name for name in methods.ordered(result.figures) if "per_step_nll" in result.figures[name]]
    if not names:
        return None
    steps = shown_steps(len(result.figures[names[0]]["per_step_nll"]))
    times = " / ".join(f"{(step + 1) * result.dt_s:.1f}" for step in steps)
    regions = [f"in the {100 * share:.0f} % region [%]" for share in REGIONS]
    rows = []
    for name in names:
        metrics = result.figures[name]
        shares = [metrics[f"per_step_coverage_{100 * share:.0f}"] for share in REGIONS]
        cells = [Cell(" / ".join(f"{100.0 * values[step]:.0f}" for step in steps)) for values in shares]
        cells.append(Cell(" / ".join(f"{metrics['per_step_nll'][step]:.2f}" for step in steps)))
        rows.append(_row(name, cells, methods))
    return Table([f"after {times} s", *regions, "NLL [nats]"], rows)


def findings_table(findings: Sequence[tuple[str, Finding]]) -> Table:
    """Expectations, the figures that decide, and the decision."""
    rows = [Row([Cell(text) for text in (name, f.claim, f.measured, f.verdict)]) for name, f in findings]
    return Table(["where", "expected", "measured", "verdict"], rows, texts=4)


def metric_cell(place: str, name: str, key: str, metrics: Mapping[str, Any], shown: bool = False) -> Cell:
    """A metric of a method in a test set; its interval is a tooltip, or `shown` behind it in Markdown too."""
    value, unit = metrics.get(key), METRICS[key].unit
    if value is None:
        return Cell(NOTHING)
    text = f"{100.0 * value:.2f} %" if unit == "%" else f"{value:.{2 if unit == 'nats' else 3}f}"
    bounds, scale = bounds_of(metrics, key), 100.0 if unit == "%" else 1.0
    words = interval([scale * end for end in bounds], digits=2 if unit == "%" else 3) if bounds else ""
    where = f"{place}.{name}.{key}"
    if shown:
        return Cell(text, where, words, unit)
    return Cell(text, where, remark=f"95 % interval {words} {unit}" if words else "")


def gap_cell(place: str, name: str, metrics: Mapping[str, Any], methods: Methods) -> Cell:
    """Paired difference of the ADE to the reference method with its interval, signed, m."""
    bounds = bounds_of(metrics, _GAP)
    if name == methods.reference.key or metrics.get(_GAP) is None or bounds is None:
        return Cell(NOTHING)
    text, where = f"{metrics[_GAP]:+.3f}", f"{place}.{name}.{_GAP}"
    return Cell(text, where, interval(bounds, "+"), remark="paired difference")


def interval(bounds: Sequence[float], sign: str = "", digits: int = 3) -> str:
    """Two ends of an interval, e.g. `0.371 to 0.392`."""
    return f"{bounds[0]:{sign}.{digits}f} to {bounds[1]:{sign}.{digits}f}"


def _row(name: str, cells: Sequence[Cell], methods: Methods) -> Row:
    return Row([Cell(methods[name].label), *cells], name, name == methods.main.key)


def metric_title(key: str) -> str:
    """Label and unit of a metric, as in a header."""
    metric = METRICS[key]
    return metric.label if metric.unit == "%" else f"{metric.label} [{metric.unit}]"
