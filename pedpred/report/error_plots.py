"""Errors over the prediction horizon, as the paper's figure, and coverage of regions of probability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.metrics.calibration import REGIONS, coverage, share_inside, shown_steps
from pedpred.report.canvas import FAINT, blank, styled
from pedpred.report.charts import ends_of, scale_of
from pedpred.report.measures import Result
from pedpred.report.methods import Methods

_READING = "below the dashed line: overconfident,\nabove it: underconfident"
_SHARES = np.linspace(0.0, 0.99, 100)
_MEASURED = 20_000


def horizon_table(result: Result, methods: Methods) -> pd.DataFrame:
    """Mean error over the horizon, m: a row per step, a column per method, and `horizon_s`."""
    columns = {name: result.figures[name]["per_step_m"] for name in methods.ordered(result.figures)}
    steps = len(next(iter(columns.values()), []))
    return pd.DataFrame({"horizon_s": [f"{result.dt_s * (k + 1):.1f}" for k in range(steps)], **columns})


@styled
def horizon_figure(result: Result, methods: Methods) -> Figure:
    """Draw boxes from the lower to the upper quartile with the median, and a line through the means."""
    figure = blank(11.0, 4.0)
    axes = figure.subplots()
    figures, step_s, names = result.figures, result.dt_s, methods.ordered(result.figures)
    width = 0.8 * step_s / len(names)
    for rank, name in enumerate(names):
        shift = (rank - (len(names) - 1) / 2) * width
        _draw_method(axes, figures[name], shift, width, step_s, methods[name].colour)
    steps = len(figures[names[0]]["per_step_m"])
    top, cut = scale_of(ends_of(figures))
    axes.set(
        xticks=np.arange(1, steps + 1) * step_s,
        xlabel="prediction horizon [s]",
        ylabel="position error [m]",
        ylim=(0.0, top),
        title=result.title,
    )
    handles = [
        Patch(color=methods[name].colour, label=_entry(methods[name].label, figures[name], name == cut))
        for name in names
    ]
    title = "box: quartiles, median\nline: mean\nfigures: ADE"
    figure.legend(handles=handles, loc="outside right upper", title=title, alignment="left")
    return figure


def _draw_method(
    axes: Axes, metrics: Mapping[str, Any], shift: float, width: float, step_s: float, colour: str
) -> None:
    middle = np.arange(1, len(metrics["per_step_m"]) + 1) * step_s + shift
    low, median, high = (np.array(metrics[f"per_step_q{q}_m"]) for q in (25, 50, 75))
    axes.bar(middle, high - low, 0.88 * width, low, color=colour, alpha=0.35, linewidth=0)
    axes.hlines(median, middle - 0.44 * width, middle + 0.44 * width, color=colour, linewidth=1.6)
    axes.plot(middle, metrics["per_step_m"], color=colour, linewidth=1.0, marker="o", markersize=2.2)


def _entry(label: str, metrics: Mapping[str, Any], cut: bool) -> str:
    beyond = f"\n(beyond: {metrics['per_step_m'][-1]:.2f} m at the end)" if cut else ""
    return f"{label}, {metrics['ade_m']:.3f} m{beyond}"


def with_covariances(windows: Sequence[EvaluationWindows], methods: Methods) -> list[str]:
    """Methods that give covariances, in the order of display."""
    return methods.ordered({name for scene in windows for name in scene.covariances})


@styled
def calibration_figure(windows: Sequence[EvaluationWindows], title: str, methods: Methods) -> Figure:
    """Draw expected and observed coverage, a panel per time ahead, a line per method with covariances."""
    figure = blank(9.6, 2.9)
    names, dt_s = with_covariances(windows, methods), windows[0].dt_s
    inside = {name: _shares(windows, name) for name in names}
    panels = shown_steps(inside[names[0]].shape[1])
    for axes, step in zip(figure.subplots(1, len(panels), sharey=True), panels, strict=True):
        axes.plot([0, 100], [0, 100], color=FAINT, linewidth=1.0, dashes=(4, 2))
        for name in names:
            _draw_line(axes, inside[name][:, step : step + 1], methods[name].colour)
        axes.set(xlim=(0, 100), ylim=(0, 100), aspect="equal", title=f"{(step + 1) * dt_s:.1f} s ahead")
        axes.set(xlabel="should lie inside [%]", ylabel="lie inside [%]" if step == 0 else "")
    figure.suptitle(f"Regions of probability, {title}", x=0.01, ha="left", fontsize=10)
    handles = [
        Line2D([], [], color=method.colour, marker="o", markersize=4.0, label=method.label)
        for method in map(methods.__getitem__, names)
    ]
    figure.legend(handles=handles, loc="outside right center", title=_READING, alignment="left")
    return figure


def _shares(windows: Sequence[EvaluationWindows], name: str) -> np.ndarray:
    """`share_inside` of at most `_MEASURED` evenly chosen windows. [W, P]."""
    every, parts = -(-sum(map(len, windows)) // _MEASURED), []
    for scene in windows:
        rows = np.arange(0, len(scene), every)
        parts.append(share_inside(scene.predictions[name].select(rows), scene.truth[rows]))
    return np.concatenate(parts)


def _draw_line(axes: Axes, inside: np.ndarray, colour: str) -> None:
    """Observed over expected coverage, %, with a dot at each region of the tables. inside: [W, 1]."""
    for shares, style in ((_SHARES, {"linewidth": 1.4}), (REGIONS, {"linestyle": "", "marker": "o"})):
        held = [100 * coverage(inside, share)[0] for share in shares]
        axes.plot(100 * np.asarray(shares), held, color=colour, markersize=4.0, **style)
