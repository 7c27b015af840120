"""Pictures of drives: curves of collisions over the time to the goal, and single episodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from pedpred.driving.episodes import Episode, Place
from pedpred.driving.forecasters import NAMES
from pedpred.driving.loop import Drive
from pedpred.driving.measures import find_contacts
from pedpred.driving.robot import Robot
from pedpred.driving.table import Condition, Episodes, Row
from pedpred.report.canvas import FAINT, INK, blank, styled
from pedpred.report.plan import draw_ground

_COLOURS = ("#7F7F7F", "#E69F00", "#0072B2", "#CC79A7", "#D55E00", "#009E73")
_COLOUR = dict(zip(NAMES, _COLOURS, strict=True))
_AROUND_M = 3.0
_DISC_S = 1.0  # people and robot are drawn so often


@styled
def curves_figure(rows: Sequence[Row]) -> Figure:
    """Draw the share of episodes with a collision at the robot's fault over the mean time to the goal.

    A method's limits of risk are joined by a line; bars are 95 % intervals over episodes.
    """
    each = Episodes.of(rows)
    figure = blank(6.0, 4.2)
    axes = figure.subplots()
    for method in dict.fromkeys(condition.method for condition in each.conditions):
        own = [condition for condition in each.conditions if condition.method == method]
        hit, time_s = [each.at_fault(one) for one in own], [each.value["time_s"][one] for one in own]
        share, mean_s = np.array([100 * v.mean() for v in hit]), np.array([v.mean() for v in time_s])
        beyond = (
            np.abs(np.array([each.draw.interval(v) for v in values]).T * scale - middle)
            for values, scale, middle in ((hit, 100, share), (time_s, 1, mean_s))
        )
        up, aside = beyond
        bars: dict[str, Any] = {"elinewidth": 0.7, "capsize": 2, "marker": "o", "markersize": 4}
        axes.errorbar(mean_s, share, up, aside, color=_COLOUR[method], label=method, **bars)
        for one, x, y in zip(own, mean_s, share, strict=True):
            if len(own) > 1:
                axes.annotate(f"{one.risk:g}", (x, y), (4, 4), textcoords="offset points", fontsize=7)
    axes.set(
        xlabel="mean time to the goal, s", ylabel="episodes with a collision at fault, %", ylim=(0, None)
    )
    axes.set_title(f"{rows[0].place}, {rows[0].robot}, {each.draw.tracks} episodes")
    axes.legend()
    return figure


@styled
def episode_figure(place: Place, episode: Episode, drives: Mapping[Condition, Drive], robot: Robot) -> Figure:
    """Draw an episode from above, a panel for each condition."""
    figure = blank(3.4 * len(drives), 3.8)
    panels = figure.subplots(1, len(drives), squeeze=False)[0]
    ways = np.concatenate([done.state[:, :2] for done in drives.values()])
    ends = np.concatenate([ways, episode.course.goal[None]])
    low, high = ends.min(axis=0) - _AROUND_M, ends.max(axis=0) + _AROUND_M
    for axes, (condition, done) in zip(panels, drives.items(), strict=True):
        draw_ground(axes, place.occupancy, 0, (low[0], high[0], low[1], high[1]))
        _draw_drive(axes, done, episode, robot)
        limit = f", limit {condition.risk:g}" if condition.risk else ""
        axes.set_title(f"{condition.method}{limit}: {(len(done.state) - 1) * done.dt_s:.1f} s")
    return figure


def _draw_drive(axes: Axes, done: Drive, episode: Episode, robot: Robot) -> None:
    """Paths of people and robot, discs every second, the goal, and crosses where they collide."""
    way, every = done.state[:, :2], round(_DISC_S / done.dt_s)
    for path in done.people.transpose(1, 0, 2):
        axes.plot(*path.T, color=FAINT, linewidth=0.9)
        axes.plot(*path[::every].T, ".", color=FAINT, markersize=4)
    axes.plot(*way.T, color=_COLOUR["kalman"], linewidth=1.6)
    for x, y in way[::every]:
        axes.add_patch(Circle((x, y), robot.radius_m, fill=False, edgecolor=_COLOUR["kalman"], lw=0.7))
    axes.plot(*episode.course.goal, "*", color=INK, markersize=9)
    found = find_contacts(done, robot.radius_m)
    for time_s, fault in zip(found.time_s, found.fault, strict=True):
        at = way[min(round(time_s / done.dt_s), len(way) - 1)]
        axes.plot(*at, "x", color=_COLOUR["modes"] if fault else INK, markersize=10, markeredgewidth=2)
