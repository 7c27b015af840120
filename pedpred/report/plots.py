"""Plots: errors over the horizon as in the paper, coverage of regions of probability, training curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pedpred.errors import InputError
from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.files import translate_errors
from pedpred.metrics.calibration import REGIONS, coverage, share_inside, shown_steps
from pedpred.report.canvas import FAINT, INK, blank, styled
from pedpred.report.methods import Methods
from pedpred.report.results import STEPS, Result
from pedpred.report.tables import scale_of

_READING = "below the dashed line: overconfident,\nabove it: underconfident"
_SHARES = np.linspace(0.0, 0.99, 100)
_MEASURED = 20_000
_ENTRY = 0.085
"""Height of an entry of the legend, as a share of the axes: curves end below it."""
_SCORES = {"validation_ade_m": "validation ADE [m]", "validation_iou": "validation IoU"}


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
    return methods.ordered({name for scene in windows for name in scene.with_covariances})


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


def read_curve(path: Path) -> pd.DataFrame:
    """Read the curve of one training: a row per validation.

    Raises:
        InputError: the file cannot be read or has no column `epoch`.
    """
    with translate_errors(partial(InputError, path, "file")):
        curve = pd.read_csv(path, sep="\t")
    if "epoch" not in curve:
        raise InputError(path, "column epoch", "it is missing")
    return curve


def by_stage(curves: Mapping[str, pd.DataFrame], methods: Methods) -> dict[str, dict[str, pd.DataFrame]]:
    """Group curves named `<stage>_<network>` or `<stage>`: stage -> key of the network or "" -> curve.

    A phase that only copied its network has a curve without rows, which is left out.
    """
    keys = sorted((method.key for method in methods), key=len, reverse=True)
    stages: dict[str, dict[str, pd.DataFrame]] = {}
    for name, curve in curves.items():
        if curve.empty:
            continue
        network = next((key for key in keys if name.endswith(f"_{key}")), "")
        stage = name.removesuffix(f"_{network}").replace("_", " ")
        stages.setdefault(stage, {})[network] = curve
    return {
        stage: {key: names[key] for key in [*[""] * ("" in names), *methods.ordered(names.keys() - {""})]}
        for stage, names in stages.items()
    }


def choose_score(columns: Sequence[str]) -> str:
    """The score of a training that is shown: a known one, else the first that it was validated by."""
    scores = [name for name in columns if name.startswith("validation_") and not name.endswith("_loss")]
    return next((name for name in _SCORES if name in scores), scores[0])


@styled
def training_figure(curves: Mapping[str, pd.DataFrame], methods: Methods) -> Figure:
    """Draw the validation score of every stage, a line per network; losses differ in meaning."""
    stages = by_stage(curves, methods)
    columns = min(4, len(stages))
    rows = -(-len(stages) // columns)
    figure = blank(2.8 * columns, 2.4 * rows)
    for rank, (stage, by_network) in enumerate(stages.items()):
        axes = figure.add_subplot(rows, columns, rank + 1)
        along = "step" if all("step" in curve for curve in by_network.values()) else "epoch"
        score = choose_score(list(next(iter(by_network.values())).columns))
        for key, curve in by_network.items():
            known = curve[curve[score].notna()] if score in curve else curve[:0]
            if len(known):
                tone, name = (methods[key].colour, f"{methods[key].label}, ") if key else (INK, "")
                label = f"{name}{known[score].iloc[-1]:.3f}"
                axes.plot(known[along].fillna(0), known[score], color=tone, linewidth=1.2, label=label)
        axes.set(title=stage, xlabel=along, ylabel=_SCORES.get(score, score))
        axes.margins(x=0.03)
        if entries := len(axes.lines):  # none where no network was fine-tuned
            low, high = axes.get_ylim()
            axes.set_ylim(low, low + (high - low) / (1 - _ENTRY * (entries + 0.5)))
            axes.legend(fontsize=7, loc="upper right", borderpad=0, borderaxespad=0, labelspacing=0.25)
    return figure
