"""Does a robot collide less? Curves of collisions over time, tables, and single drives from above.

The figures are those of `pedpred.driving.figures`, as plain values; a drive is a scene whose robot is the
track with the largest id, and what `pedpred.driving.shown.describe` says of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from pedpred.errors import InputError
from pedpred.files import read_json
from pedpred.report.canvas import FAINT, INK, blank, styled
from pedpred.report.document import NOTHING, Block, Cell, Picture, Pictures, Row, Section, Table, Text
from pedpred.report.plan import draw_ground
from pedpred.scenes import Scene
from pedpred.storage.scenes import read_scene

FORECASTERS = {
    "standing": ("people stand", "#E69F00"),
    "constant_velocity": ("constant velocity", "#7F7F7F"),
    "kalman": ("Kalman filter", "#0072B2"),
    "point": ("network, one path", "#CC79A7"),
    "modes": ("network, all modes", "#D55E00"),
    "social_force": ("social forces, true goals", "#009E73"),
    "true_future": ("true future", "#56B4E9"),
    "lstm": ("LSTM", "#882255"),
}
"""Words and colour of each forecaster; colours are those of conf/report/methods.yaml."""
LABELS = {key: label for key, (label, _) in FORECASTERS.items()}
"""Names of forecasters in words; other networks keep their names."""
_CERTAIN, _MARKERS = "o", "sD^vP*X"
"""Marker of methods without a limit of risk; those of the limits, from the smallest, in all curves."""
_OTHER, _ROBOT, _FAULT = "#8C564B", "#0072B2", "#D55E00"
_AROUND_M = 3.0
_DISC_S = 1.0  # people and robot are drawn so often

Figures = Mapping[str, Any]
"""Of one place: those of `pedpred.driving.figures.figures_of`."""


class Shown(NamedTuple):
    """One episode as it is shown.

    Attributes:
        kind: `helps`, `hinders` or `usual`.
        episode: its number.
        drives: scene and description of each condition.
        recording: where the drive with the network's modes is as MCAP; empty: nowhere.
    """

    kind: str
    episode: int
    drives: Sequence[tuple[Scene, Mapping[str, Any]]]
    recording: str = ""


def read_shown(drives: Path) -> list[Shown]:
    """Read the shown episodes that the stage `drive` wrote.

    Raises:
        InputError: a file is missing or damaged.
    """
    path, shown = drives / "shown.json", []
    for kind, own in read_json(path, partial(InputError, path, "file", remedy="Write it again")).items():
        driven = [(read_scene(drives / f"{kind}_{about['method']}"), about) for about in own["drives"]]
        recording = drives / f"{kind}.mcap"
        shown.append(Shown(kind, own["episode"], driven, recording.as_posix() if recording.exists() else ""))
    return shown


@styled
def curves_figure(figures: Figures) -> Figure:
    """Draw the share of episodes with a collision at the robot's fault over the mean time to the goal.

    A method's limits of risk are joined by a line in the order of their times, as methods are compared at
    equal times, and each limit has a marker in all curves; bars are 95 % intervals over episodes.
    """
    figure = blank(7.8, 4.2)
    axes, handles = figure.subplots(), list[Artist]()
    curves = [limits for limits in figures["methods"].values() if len(limits) > 1]
    marker = dict(zip(sorted({risk for limits in curves for risk in limits}, key=float), cycle(_MARKERS)))
    for method, limits in figures["methods"].items():
        risks, points = zip(*sorted(limits.items(), key=lambda limit: limit[1]["time_s"]), strict=True)
        middle, ends = (
            np.array([[one[f"{key}{part}"] for one in points] for key in ("time_s", "at_fault")])
            for part in ("", "_ci95")
        )
        (aside, up), (time_s, share) = np.abs(np.swapaxes(ends, 1, 2) - middle[:, None]), middle
        label, colour = FORECASTERS.get(method, (method, _OTHER))
        axes.errorbar(time_s, 100 * share, 100 * up, aside, color=colour, elinewidth=0.7, capsize=2)
        shapes = [marker[risk] if len(limits) > 1 else _CERTAIN for risk in risks]
        for shape, x, y in zip(shapes, time_s, share, strict=True):
            axes.plot(x, 100 * y, shape, color=colour, markersize=5, clip_on=False, zorder=3)
        handles.append(Line2D([], [], color=colour, marker="" if len(limits) > 1 else _CERTAIN, label=label))
    handles += [
        Line2D([], [], color=INK, linestyle="", marker=shape, label=f"limit of risk {risk}")
        for risk, shape in marker.items()
    ]
    axes.set(xlabel="mean time to the goal, s", ylabel="episodes with a collision at fault, %")
    axes.set_ylim(0, None)
    axes.set_title(f"{figures['place']}, {figures['robot']}, {figures['episodes']} episodes")
    figure.legend(handles=handles, loc="outside right upper")
    return figure


@styled
def episode_figure(drives: Sequence[tuple[Scene, Mapping[str, Any]]]) -> Figure:
    """Draw an episode from above, a panel for each condition, at least as wide as high: titles need width."""
    figure = blank(3.4 * len(drives), 3.8)
    panels = figure.subplots(1, len(drives), squeeze=False)[0]
    goals = [about["goal"] for _, about in drives]
    ends = np.concatenate([*(_robot_path(scene) for scene, _ in drives), np.array(goals)])
    low, high = ends.min(axis=0) - _AROUND_M, ends.max(axis=0) + _AROUND_M
    width_m, height_m = high - low
    aside_m = max(height_m - width_m, 0.0) / 2
    for axes, (scene, about) in zip(panels, drives, strict=True):
        draw_ground(axes, scene.occupancy, 0, (low[0] - aside_m, high[0] + aside_m, low[1], high[1]))
        _draw_drive(axes, scene, about)
        limit = f", limit {about['risk']:g}" if about["risk"] else ""
        late = "" if about["reached"] else ", not reached"
        label = LABELS.get(about["method"], about["method"])
        axes.set_title(f"{label}{limit}: {about['time_s']:.1f} s{late}", fontsize=9)
    return figure


def _robot_path(scene: Scene) -> np.ndarray:
    people = scene.trajectories
    return np.asarray(people.position[people.track_id == people.track_id.max()])


def _draw_drive(axes: Axes, scene: Scene, about: Mapping[str, Any]) -> None:
    """Paths of people and robot, discs every second, the goal, and crosses where they collide."""
    people, way = scene.trajectories, _robot_path(scene)
    first_s, robot = people.time_s.min(), people.track_id.max()
    whole = np.abs((people.time_s - first_s + 0.5 * _DISC_S) % _DISC_S - 0.5 * _DISC_S) < 1e-3
    for rows in people.by_track()[:-1]:
        axes.plot(*people.position[rows].T, color=FAINT, linewidth=0.9)
        axes.plot(*people.position[rows[whole[rows]]].T, ".", color=FAINT, markersize=4)
    axes.plot(*way.T, color=_ROBOT, linewidth=1.6)
    for x, y in people.position[(people.track_id == robot) & whole]:
        axes.add_patch(Circle((x, y), about["radius_m"], fill=False, edgecolor=_ROBOT, lw=0.7))
    axes.plot(*about["goal"], "*", color=INK, markersize=9)
    for contact in about["contacts"]:
        colour = _FAULT if contact["fault"] else INK
        axes.plot(*contact["at"], "x", color=colour, markersize=10, markeredgewidth=2)


def drives_section(places: Mapping[str, tuple[Figures, Sequence[Shown]]]) -> Section:
    """Write the section on drives; without blocks where nobody drove.

    Args:
        places: name of a row of conf/driving -> figures, and the episodes that are shown.
    """
    answers = [answer(name, figures) for name, (figures, _) in places.items()]
    parts = [_place_section(name, *driven) for name, driven in places.items()]
    blocks: list[Block] = [Text(_ABOUT), *(Text(words, "note") for words in answers if words), *parts]
    return Section("Does a robot collide less?", blocks if places else [], "drives")


_ABOUT = (
    "A simulated robot drives among people with one planner and a forecaster in the loop. All methods drive "
    "the same episodes, drawn so that an undisturbed robot would come within 0.8 m of somebody. Point "
    "forecasts are taken for certain; the others have a curve, with a point for each limit of the "
    "probability to overlap somebody. Intervals are of 95 %, over episodes. The measures are those of "
    "Francis et al. 2023; a robot that stands is never at fault. Only social forces are given the true "
    "goals, and only the true future the future. So few episodes leave wide intervals: docs/driving.md has "
    "100 to 200 of them at each place."
)


def answer(name: str, figures: Figures) -> str:
    """Compare the network's modes with each other curve at the same time to the goal, in a sentence each."""
    said = []
    for other, comparison in figures["equal_time"].items():
        low, high = (100 * end for end in comparison["at_fault_ci95"])
        verdict = "fewer" if high < 0 else "more" if low > 0 else "neither clearly fewer nor more"
        points = round(100 * comparison["at_fault"], 1)
        way = "fewer" if points < 0 else "more"
        amount = f"{abs(points):.1f} percentage points {way}" if points else "as many"
        said.append(
            f"{_words(name)}: where both take {comparison['time_s']:.1f} s to the goal, {amount} episodes "
            f'have a collision at fault with "{LABELS["modes"]}" {"as" if amount == "as many" else "than"} '
            f'with "{LABELS.get(other, other)}" (95 % interval of the difference {low:+.1f} to {high:+.1f}, '
            f"{figures['episodes']} episodes): {verdict}."
        )
    return " ".join(said)


_MEASURES = {
    "success, %": ("success", 100.0, ".0f"),
    "human collisions, %": ("collisions", 100.0, ".0f"),
    "in time, %": ("reached", 100.0, ".0f"),
    "wall collisions": ("wall_contacts", 1.0, ".2f"),
    "time to goal, s": ("time_s", 1.0, ".1f"),
    "path length / route": ("path_ratio", 1.0, ".2f"),
    "personal space intruded, s": ("intrusion_s", 1.0, ".1f"),
    "stopped, s": ("stopped_s", 1.0, ".1f"),
    "jerk, m/s³": ("jerk_mps3", 1.0, ".2f"),
}
"""Columns of the table after the collisions at fault: figure, factor and format."""
FAULT = "at fault, %"


def drives_table(figures: Figures) -> Table:
    """Write all measures, a row for each method and limit of risk."""
    rows = []
    for method, limits in figures["methods"].items():
        for risk, measures in limits.items():
            low, high = (100 * end for end in measures["at_fault_ci95"])
            fault = Cell(f"{100 * measures['at_fault']:.0f}", bounds=f"{low:.0f}-{high:.0f}", unit="%")
            found = [(measures[key], scale, form) for key, scale, form in _MEASURES.values()]
            texts = [
                NOTHING if value is None else format(scale * value, form) for value, scale, form in found
            ]
            names = [LABELS.get(method, method), risk if len(limits) > 1 else NOTHING]
            rows.append(Row([*map(Cell, names), fault, *map(Cell, texts)]))
    return Table(["method", "limit", FAULT, *_MEASURES], rows, texts=2)


_KINDS = {
    "helps": "The episode in which the network's modes do best compared with the Kalman filter",
    "hinders": "The worst one: ranked by collisions at fault, then all collisions, then time",
    "usual": "The episode in the middle",
}
_DRAWN = (
    "Blue: the robot, a circle every second; star: its goal; grey: people, a dot every second; crosses: "
    "collisions, orange at the robot's fault."
)


def _place_section(name: str, figures: Figures, shown: Sequence[Shown]) -> Section:
    """Curves, table and episodes of a place."""
    caption = "Collisions at fault over the time to the goal; bars: 95 % intervals over episodes."
    curves, pictures = Picture(f"{name}_curves", caption, curves_figure(figures)), []
    for kind, episode, drives, recording in shown:
        where = f" With its forecasts: {recording}." if recording else ""
        words = f"{_KINDS[kind]} (number {episode}). {_DRAWN}{where}"
        pictures.append(Picture(f"{name}_{kind}", words, episode_figure(drives)))
    further = [Pictures(pictures)] if pictures else []
    return Section(_words(name), [Pictures([curves]), drives_table(figures), *further])


def _words(name: str) -> str:
    words = name.replace("_", " ")
    return words[0].upper() + words[1:]
