"""Errors over the prediction horizon, as the paper's figure, and coverage of regions of probability."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.metrics.calibration import REGIONS, coverage, share_inside, shown_steps
from pedpred.report.canvas import FAINT, blank, styled
from pedpred.report.methods import Methods
from pedpred.report.results import STEPS, Result
from pedpred.report.tables import scale_of

_READING = "below the dashed line: overconfident,\nabove it: underconfident"
_SHARES = np.linspace(0.0, 0.99, 100)
_MEASURED = 20_000


def horizon_table(result: Result, methods: Methods) -> pd.DataFrame:
    """Mean error over the horizon, m: a row per step, a column per method, and `horizon_s`."""
    errors_m = result.figures.over_steps("per_step_m")[methods.ordered(result.figures.methods)]
    times = [f"{result.dt_s * step:.1f}" for step in errors_m.index]
    errors_m.insert(0, "horizon_s", times)
    return errors_m


@styled
def horizon_figure(result: Result, methods: Methods) -> Figure:
    """Draw boxes from the lower to the upper quartile with the median, and a line through the means."""
    figure, figures = blank(11.0, 4.0), result.figures
    axes, names = figure.subplots(), methods.ordered(figures.methods)
    means, *quartiles = (figures.over_steps(key) for key in STEPS)
    width, times = 0.8 * result.dt_s / len(names), np.arange(1, len(means) + 1) * result.dt_s
    for rank, name in enumerate(names):
        middle, colour = times + (rank - (len(names) - 1) / 2) * width, methods[name].colour
        low, median, high = (quartile[name].to_numpy() for quartile in quartiles)
        axes.bar(middle, high - low, 0.88 * width, low, color=colour, alpha=0.35, linewidth=0)
        axes.hlines(median, middle - 0.44 * width, middle + 0.44 * width, color=colour, linewidth=1.6)
        axes.plot(middle, means[name], color=colour, linewidth=1.0, marker="o", markersize=2.2)
    top, cut = scale_of({name: max(means[name].iloc[-1], quartiles[-1][name].iloc[-1]) for name in names})
    axes.set(xticks=times, xlabel="prediction horizon [s]", ylabel="position error [m]", ylim=(0.0, top))
    axes.set_title(result.title)
    handles = []
    for name in names:
        beyond = f"\n(beyond: {means[name].iloc[-1]:.2f} m at the end)" if name == cut else ""
        label = f"{methods[name].label}, {figures.value(name):.3f} m{beyond}"
        handles.append(Patch(color=methods[name].colour, label=label))
    title = "box: quartiles, median\nline: mean\nfigures: ADE"
    figure.legend(handles=handles, loc="outside right upper", title=title, alignment="left")
    return figure


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
