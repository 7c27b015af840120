"""Where straight forecasts meet walls: windows chosen by rule, errors over the share of such forecasts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import cycle, pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.report.canvas import FAINT, INK, blank, styled
from pedpred.report.instants import Instant
from pedpred.report.measures import Figures, Result
from pedpred.report.methods import Method, Methods
from pedpred.report.plan import draw_ground
from pedpred.report.situation import draw_situation, drawn_points, legend_handles, reading_of_modes
from pedpred.scenes import Scene

RANKS = (0.1, 0.35, 0.65, 0.9)
"""Quantiles of the main method's error at which windows are shown."""
LEAST_SHARE = 0.02
"""Places where at least this share of straight forecasts' points lies in obstacles are shown."""
_MARGIN_M = 0.6
"""Ground shown around the paths, m."""
_NEAR = 2.5
"""Names of places whose shares differ by a smaller factor are written to either side."""
_MARKS = (("o", INK), ("s", "#009E73"), ("^", "#D55E00"), ("D", "#0072B2"))


def wall_windows(windows: EvaluationWindows, scene: Scene, methods: Methods) -> np.ndarray:
    """Choose windows whose straight continuation meets a wall, by people and errors. [<= len(RANKS)] rows.

    For each person, take the first window in which most points of the straight forecast lie in obstacles; of
    these, choose those at `RANKS` of the main method's ADE, whether it is good there or not.
    """
    share = scene.occupancy.is_occupied(windows.predictions[methods.simple[0].key].point).mean(axis=1)
    order = np.lexsort((windows.time_s, -share, windows.track_id))
    _, first = np.unique(windows.track_id[order], return_index=True)
    rows = order[first][share[order[first]] > 0]
    rows = rows[np.argsort(windows.ade_m(methods.main.key)[rows], kind="stable")]
    return rows[np.unique(np.round(np.array(RANKS) * (len(rows) - 1)).astype(int))] if len(rows) else rows


def wall_caption(scene: Scene, windows: EvaluationWindows, methods: Methods) -> str:
    """What `wall_figure` shows, and by which rule."""
    ranks = ", ".join(f"{100 * rank:.0f}" for rank in RANKS)
    straight, main = methods.simple[0].label, methods.main
    return (
        f"{scene.name}: for each person, the window in which most points of the {straight} forecast lie in "
        f"obstacles; shown are those at the {ranks} % quantiles of the {main.label}'s error. "
        "Dots: point forecasts; "
        f"{reading_of_modes([windows], main)}dashed: the true path; grey: other people."
    )


@styled
def wall_figure(scene: Scene, windows: EvaluationWindows, rows: np.ndarray, methods: Methods) -> Figure:
    """Draw windows side by side at one scale: the main method's forecast, the straight one and the truth."""
    shown = (methods.main, methods.simple[0])
    points = drawn_points(windows, rows, shown)
    middle = (points.min(axis=1) + points.max(axis=1)) / 2
    half_m = np.ptp(points, axis=1).max() / 2 + _MARGIN_M
    figure = blank(2.7 * len(rows), 3.4)
    for axes, row, (x, y) in zip(
        figure.subplots(1, len(rows), squeeze=False)[0], rows.tolist(), middle, strict=True
    ):
        instant = Instant(
            scene.name, float(windows.time_s[row]), np.array([row]), row, int(windows.track_id[row])
        )
        draw_ground(axes, scene.occupancy, 0, (x - half_m, x + half_m, y - half_m, y + half_m))
        draw_situation(axes, scene, windows, instant, shown, lambda points: points)
        errors = ", ".join(f"{method.label} {windows.ade_m(method.key)[row]:.2f}" for method in shown)
        axes.set_title(f"ADE [m]: {errors}", fontsize=8.5)
    figure.legend(handles=legend_handles(shown), loc="outside lower left", ncols=3)
    return figure


@dataclass(frozen=True)
class Gain:
    """A method's error in one place or room.

    Attributes:
        name: of the place.
        group: in words, with what its network was trained on.
        share: of the straight forecast's points that lie in obstacles.
        ratio: ADE of the method / of the best simple one.
        bounds: 95 % interval of the ratio's numerator, on the same scale.
        named: whether the name is drawn.
    """

    name: str
    group: str
    share: float
    ratio: float
    bounds: tuple[float, float]
    named: bool


def best_simple(figures: Figures, methods: Methods) -> str | None:
    """The simple method with the least ADE; None where no simple one was evaluated."""
    known = [method.key for method in methods.simple if method.key in figures]
    return min(known, key=lambda key: figures[key]["ade_m"], default=None)


def gains(results: Iterable[Result], group: str, methods: Methods, method: Method) -> list[Gain]:
    """The gain of a method at each place, and in each single scene of a pooled test set.

    A place where the best simple method is exact, as on made-up straight lines, or where none was evaluated,
    has no ratio and is left out.
    """
    gained = []
    for result in results:
        for name, figures in (result.parts or {result.name: result.figures}).items():
            best = best_simple(figures, methods)
            if method.key not in figures or best is None or not figures[best]["ade_m"]:
                continue
            metrics, base_m = figures[method.key], figures[best]["ade_m"]
            low, high = (end / base_m for end in metrics["ade_m_ci95"])
            ratio = metrics["ade_m"] / base_m
            share = figures.get(methods.simple[0].key, {}).get("obstacle_share", math.nan)
            gained.append(Gain(name, group, share, ratio, (low, high), not result.parts))
    return gained


@styled
def gains_figure(gained: Sequence[Gain], methods: Methods) -> Figure:
    """Draw the relative error over the share of straight forecasts' points in obstacles, a mark per group."""
    figure = blank(9.0, 4.2)
    axes = figure.subplots()
    axes.axhline(1.0, color=FAINT, linewidth=1.0)
    groups = list(dict.fromkeys(gain.group for gain in gained))
    for group, (mark, colour) in zip(groups, cycle(_MARKS), strict=False):
        group_gains = [gain for gain in gained if gain.group == group]
        share = 100 * np.array([gain.share for gain in group_gains])
        bounds = np.transpose([gain.bounds for gain in group_gains])
        axes.vlines(share, *bounds, color=colour, linewidth=0.8, alpha=0.6)
        axes.plot(share, [gain.ratio for gain in group_gains], mark, color=colour, markersize=5, label=group)
    _draw_names(axes, gained)
    main, straight = methods.main.label, methods.simple[0].label
    axes.set_xscale("symlog", linthresh=0.1)
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    ticks = [tick for tick in (0.2, 0.3, 0.4, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0) if low <= tick <= high]
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_yticks([], minor=True)
    axes.set(xlabel=f"points of {straight} in obstacles [%]", ylabel=f"ADE {main} / best simple method")
    axes.set_xticks([0, 0.1, 1, 10], ["0", "0.1", "1", "10"])
    figure.legend(loc="outside upper left", ncols=len(groups))
    return figure


def _draw_names(axes: Axes, gained: Sequence[Gain]) -> None:
    """Write each name once, above its highest mark; those of one share in lines, the highest mark first."""
    top = {gain.name: gain for gain in sorted(gained, key=lambda gain: gain.bounds[1]) if gain.named}
    of_share: dict[float, list[Gain]] = {}
    for gain in sorted(top.values(), key=lambda gain: (gain.share, -gain.ratio)):
        of_share.setdefault(gain.share, []).append(gain)
    shares = list(of_share)
    near = [two < _NEAR * one for one, two in pairwise(shares)]
    for share, crowded, follows in zip(shares, [*near, False], [False, *near], strict=True):
        side = "right" if crowded else "left" if follows else "center"
        names = "\n".join(gain.name for gain in of_share[share])
        at = (100 * share, max(gain.bounds[1] for gain in of_share[share]))
        axes.annotate(names, at, (0, 4), textcoords="offset points", ha=side, fontsize=8, linespacing=1.0)
