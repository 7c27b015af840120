"""The page on the validation of the simulated walking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pedpred.report.canvas import FAINT, INK, blank, styled
from pedpred.report.document import Cell, Picture, Pictures, Row, Section, Table, Text
from pedpred.report.findings import Finding
from pedpred.report.plan import draw_ground
from pedpred.report.tables import findings_table
from pedpred.scenes import Scene

LEAST_REACHED, MOST_SLOW = 0.995, 0.01
_FORWARD, _BACKWARD, _TAIL_S = "#0072B2", "#D55E00", 2.4


def walking_findings(shares: Mapping[str, Any]) -> list[Finding]:
    """Judge the requirements on a data set."""
    blocked, fast = shares["in_obstacle_share"], shares["above_cap_share"]
    reached, slow = shares["targets_reached_share"], shares["slow_outside_queues_share"]
    in_time = f"at least {LEAST_REACHED:.1%} of targets within 3 x the free-walk time"
    rules = [
        ("no state in an obstacle", blocked, blocked == 0),
        ("no state above the speed cap", fast, fast == 0),
        (in_time, reached, reached >= LEAST_REACHED),
        (f"under {MOST_SLOW:.0%} of states slower than 0.2 m/s outside queues", slow, slow < MOST_SLOW),
    ]
    return [Finding(claim, f"{share:.2%}", "met" if holds else "missed") for claim, share, holds in rules]


def weidmann_speed_mps(density_per_m2: np.ndarray) -> np.ndarray:
    """Observed speeds, v = 1.34 (1 - exp(-1.913 (1/rho - 1/5.4))) m/s. Weidmann 1993 (Kladek's form)."""
    return 1.34 * (1.0 - np.exp(-1.913 * (1.0 / np.asarray(density_per_m2) - 1.0 / 5.4)))


@styled
def flow_figure(rows: Sequence[Mapping[str, float]]) -> Figure:
    """Draw speed over density beside Weidmann's observations, and lane order beside that of chance."""
    figure = blank(9.0, 3.4)
    speed, lanes = figure.subplots(1, 2)
    density = np.array([row["density_per_m2"] for row in rows])
    seen = np.linspace(0.02, max(2.0, 1.1 * density.max()), 200)
    speed.plot(seen, weidmann_speed_mps(seen), color=FAINT, linewidth=2, label="Weidmann 1993, observed")
    speed.plot(density, [row["speed_mps"] for row in rows], "o-", color=_FORWARD, label="simulated")
    speed.set(xlabel="density [1/m²]", ylabel="mean speed [m/s]", ylim=(0.0, None), title="Speed and density")
    lanes.plot(density, [row["lane_order"] for row in rows], "o-", color=_FORWARD, label="simulated")
    shuffled = [row["lane_order_shuffled"] for row in rows]
    lanes.plot(density, shuffled, "o--", color=FAINT, label="directions shuffled")
    lanes.set(xlabel="density [1/m²]", ylabel="lane order", ylim=(0.0, None), title="Lanes")
    for axes in (speed, lanes):
        axes.legend()
    return figure


@styled
def lanes_figure(scene: Scene) -> Figure:
    """Draw the last instant of a run: people with the last seconds of their paths, coloured by direction."""
    width, depth = scene.occupancy.extent_m
    figure = blank(9.0, 0.6 + 9.0 * depth / width)
    axes = figure.subplots()
    draw_ground(axes, scene.occupancy, 0)
    people = scene.trajectories
    assert people.velocity is not None
    end_s = people.time_s.max()
    for rows in people.by_track():
        if people.time_s[rows[-1]] == end_s:
            colour = _FORWARD if people.velocity[rows[-1], 0] > 0 else _BACKWARD
            tail = rows[people.time_s[rows] >= end_s - _TAIL_S]
            axes.plot(*people.position[tail].T, color=colour, linewidth=1, alpha=0.6)
            axes.plot(*people.position[rows[-1]], "o", color=colour, markersize=5)
    marks = [Line2D([], [], color=c, marker="o", linestyle="") for c in (_FORWARD, _BACKWARD)]
    axes.legend(marks, ["to the right", "to the left"], loc="lower right", ncols=2, bbox_to_anchor=(1, -0.2))
    axes.spines[:].set_color(INK)
    return figure


def crowd_section(
    sets: Mapping[str, Mapping[str, Any]], flow: Sequence[Mapping[str, float]], lanes: Scene
) -> Section:
    """Write what was demanded of the walking, the figures, and the two experiments.

    `sets` holds `Walking.shares` of each data set; `lanes` is the run whose lanes are clearest.
    """
    findings = [(name, finding) for name, shares in sets.items() for finding in walking_findings(shares)]
    rows = [
        Row([Cell(name), *(Cell(format(shares[key], form)) for key, form in _SET_COLUMNS.values())])
        for name, shares in sets.items()
    ]
    text = (
        "Every recorded state of every simulated set is checked. Queueing: another person less than 1 m "
        "ahead; free-walk time: the way around the obstacles at the desired speed."
    )
    caption = "The last instant of the run with the clearest lanes, people coloured by direction."
    last = Pictures([Picture("lanes", caption, lanes_figure(lanes))])
    title = "Validation of the simulated walking"
    checks = [findings_table(findings), Table(["set", *_SET_COLUMNS], rows)]
    return Section(title, [Text(text), *checks, flow_section(flow), last])


def flow_section(flow: Sequence[Mapping[str, float]]) -> Section:
    """Write the experiment in a corridor: rows of `corridor_flow`."""
    text = (
        "Two opposite streams in a corridor, measured in its middle with PedPy; the curve is Weidmann's "
        "(1993) fit to observations, to which nothing was fitted here. Lane order of Rex and Löwen (2007), 1 "
        "for perfect lanes; beside it that of shuffled directions."
    )
    picture = Picture("flow", "Speed over density, lane order over density.", flow_figure(flow))
    runs = [Row([Cell(format(row[key], form)) for key, form in _FLOW_COLUMNS.values()]) for row in flow]
    table = Table(list(_FLOW_COLUMNS), runs, texts=0)
    return Section("Simulated walking: density, speed and lanes", [Text(text), Pictures([picture]), table])


_SET_COLUMNS = {
    "states": ("states", "d"),
    "speed / desired": ("mean_speed_over_desired", ".2f"),
    "below 0.2 m/s": ("slow_share", ".2%"),
    "nearer than 0.3 m": ("close_share", ".2%"),
    "targets": ("targets", "d"),
    "in time": ("targets_reached_share", ".2%"),
}
_FLOW_COLUMNS = {
    "people": ("people", ".0f"),
    "density [1/m²]": ("density_per_m2", ".2f"),
    "speed [m/s]": ("speed_mps", ".2f"),
    "lane order": ("lane_order", ".2f"),
    "shuffled": ("lane_order_shuffled", ".2f"),
}
