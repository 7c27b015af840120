"""Where straight forecasts meet walls: windows chosen by rule, errors over the share of such forecasts."""

from __future__ import annotations

from dataclasses import replace
from itertools import cycle, pairwise

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.report.canvas import FAINT, INK, blank, styled
from pedpred.report.document import Picture
from pedpred.report.gather import Evaluated
from pedpred.report.instants import Instant
from pedpred.report.methods import Methods
from pedpred.report.plan import quarter_turns_of, turn_points
from pedpred.report.scene_picture import drawn_points, legend_handles, reading_of_modes, scene_picture
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


def wall_pictures(evaluated: Evaluated, how: str, methods: Methods) -> list[Picture]:
    """Forecasts at the places where straight ones often meet walls; `how` says how networks were trained."""
    pictures, straight, main = [], methods.simple[0], methods.main
    ranks = ", ".join(f"{100 * rank:.0f}" for rank in RANKS)
    for result in evaluated.results:
        share = result.figures.get(straight.key, "obstacle_share")
        windows = evaluated.windows.get(result.name)
        if windows is None or not {main.key, straight.key} <= windows.predictions.keys():
            continue
        if share is None or share.value < LEAST_SHARE:
            continue
        caption = (
            f"{result.name}: for each person, the window in which most points of the {straight.label} "
            f"forecast lie in obstacles; shown are those at the {ranks} % quantiles of the {main.label}'s "
            f"error. Dots: point forecasts; {reading_of_modes([windows], main)}dashed: the true path; grey: "
            f"other people. Networks: {how}."
        )
        scene = evaluated.scene(result.name)
        figure = wall_figure(scene, windows, wall_windows(windows, scene, methods), methods)
        pictures.append(Picture(f"walls_{result.name}", caption, figure))
    return pictures


@styled
def wall_figure(scene: Scene, windows: EvaluationWindows, rows: np.ndarray, methods: Methods) -> Figure:
    """Draw windows side by side at one scale: the main method's forecast, the straight one and the truth."""
    shown, turns = (methods.main, methods.simple[0]), quarter_turns_of(scene.camera)
    points = turn_points(drawn_points(windows, rows, shown), turns)
    middle = (points.min(axis=1) + points.max(axis=1)) / 2
    half_m = np.ptp(points, axis=1).max() / 2 + _MARGIN_M
    figure = blank(2.7 * len(rows), 3.4)
    panels = figure.subplots(1, len(rows), squeeze=False)[0]
    for axes, row, (x, y) in zip(panels, rows.tolist(), middle, strict=True):
        instant = replace(Instant.of(scene.name, windows, row), rows=np.array([row]))
        extent = (x - half_m, x + half_m, y - half_m, y + half_m)
        scene_picture(axes, scene, instant, windows, shown, extent)
        errors = ", ".join(f"{method.label} {windows.ade_m(method.key)[row]:.2f}" for method in shown)
        axes.set_title(f"ADE [m]: {errors}", fontsize=8.5)
    figure.legend(handles=legend_handles(shown), loc="outside lower left", ncols=3)
    return figure


@styled
def gains_figure(gains: pd.DataFrame, methods: Methods) -> Figure:
    """Draw the relative error over the share of straight forecasts' points in obstacles, a mark per group.

    Rows have the group, the place, whether it is `named`, its share, and the ratio with its interval.
    """
    figure = blank(9.0, 4.2)
    axes, groups = figure.subplots(), list(gains.groupby("group", sort=False))
    axes.axhline(1.0, color=FAINT, linewidth=1.0)
    for (group, own), (mark, colour) in zip(groups, cycle(_MARKS), strict=False):
        share = 100 * own["share"]
        axes.vlines(share, own["low"], own["high"], color=colour, linewidth=0.8, alpha=0.6)
        axes.plot(share, own["ratio"], mark, color=colour, markersize=5, label=group)
    _draw_names(axes, gains[gains["named"]])
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


def _draw_names(axes: Axes, gains: pd.DataFrame) -> None:
    """Write each name once, above its highest mark; those of one share in lines, the highest mark first."""
    highest = gains.sort_values("high", kind="stable").drop_duplicates("place", keep="last")
    of_share = highest.sort_values(["share", "ratio"], ascending=[True, False], kind="stable").groupby(
        "share"
    )
    near = [two < _NEAR * one for one, two in pairwise(of_share.groups)]
    for (share, own), crowded, follows in zip(of_share, [*near, False], [False, *near], strict=True):
        side = "right" if crowded else "left" if follows else "center"
        at, names = (100 * share, own["high"].max()), "\n".join(own["place"])
        axes.annotate(names, at, (0, 4), textcoords="offset points", ha=side, fontsize=8, linespacing=1.0)
