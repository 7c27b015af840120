"""The plan view: obstacles, people, forecasts and tracks seen from above, in metres."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, to_rgba
from matplotlib.figure import Figure

from pedpred.geometry import rotate
from pedpred.report.canvas import FAINT, INK, OBSTACLE, blank, styled
from pedpred.scenes import Camera, OccupancyMap, Scene, Trajectories

_SHEET_IN, _GAP_M = 11.0, 1.0  # width of a contact sheet, ground between its rooms
_TRACK_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F")
_BLACK = ListedColormap([(0.0, 0.0, 0.0, 0.0), to_rgba(OBSTACLE)])
_OBSTACLES: dict[str, Any] = {"cmap": _BLACK, "vmin": 0, "vmax": 1, "origin": "lower"}


def turn_points(points: np.ndarray, quarter_turns: int) -> np.ndarray:
    """World points (m, [..., 2]) in the plan, which lies turned counter-clockwise."""
    return rotate(points, np.array(quarter_turns * np.pi / 2))


def quarter_turns_of(camera: Camera | None) -> int:
    """By how many quarter turns the plan has to be turned to lie like the camera's picture."""
    if camera is None:
        return 0
    rows, columns = camera.picture.shape[:2]
    centre = camera.homography.to_world(np.array([rows / 2, columns / 2]))
    row, column = camera.homography.to_image(centre + np.array([0.1, 0.0])) - [rows / 2, columns / 2]
    return round(np.arctan2(-row, column) / (np.pi / 2)) % 4


def obstacle_image(
    occupancy: OccupancyMap, quarter_turns: int
) -> tuple[np.ndarray, tuple[float, float, float, float]]:
    """The map as an image whose row 0 is at the bottom, and its extent (left, right, bottom, top), m."""
    image = np.rot90(occupancy.occupied.T, -quarter_turns)
    corners = turn_points(np.array([occupancy.origin, occupancy.origin + occupancy.extent_m]), quarter_turns)
    (left, bottom), (right, top) = corners.min(axis=0), corners.max(axis=0)
    return image, (float(left), float(right), float(bottom), float(top))


def draw_ground(
    axes: Axes, occupancy: OccupancyMap, quarter_turns: int, shown: Sequence[float] | None = None
) -> None:
    """Obstacle cells in black, a frame around the map, and a bar of two metres instead of axes.

    Args:
        axes: to draw into.
        occupancy: the map.
        quarter_turns: by which it is turned, counter-clockwise.
        shown: left, right, bottom and top of the part to show, m; all by default.
    """
    image, whole = obstacle_image(occupancy, quarter_turns)
    axes.imshow(image, extent=whole, interpolation="nearest", **_OBSTACLES)
    extent = whole if shown is None else shown
    axes.set(xticks=[], yticks=[], aspect="equal", xlim=extent[:2], ylim=extent[2:])
    axes.spines[:].set(visible=True, color=FAINT)
    below = extent[2] - 0.035 * (extent[3] - extent[2])
    axes.plot([extent[0], extent[0] + 2.0], [below, below], color=INK, linewidth=2, clip_on=False)
    axes.text(extent[0] + 2.3, below, "2 m", va="center", fontsize=8)


def extent_around(points: np.ndarray, margin_m: float, whole: Sequence[float]) -> list[float]:
    """Left, right, bottom and top of the square around points [..., 2], as far as it is in the `whole`, m."""
    low, high = points.reshape(-1, 2).min(axis=0), points.reshape(-1, 2).max(axis=0)
    (x, y), half_m = (low + high) / 2, (high - low).max() / 2 + margin_m
    left, right, bottom, top = whole
    return [max(x - half_m, left), min(x + half_m, right), max(y - half_m, bottom), min(y + half_m, top)]


def draw_tracks(axes: Axes, paths: Sequence[np.ndarray], width: float = 0.7) -> None:
    """One thin line per path ([M, 2], m); colours only tell neighbours apart."""
    colour = [_TRACK_COLOURS[k % len(_TRACK_COLOURS)] for k in range(len(paths))]
    axes.add_collection(LineCollection(paths, colors=colour, linewidths=width, alpha=0.6))


def first_paths(trajectories: Trajectories, shown_s: float) -> list[np.ndarray]:
    """Each track's positions in the first `shown_s` seconds, in order of time, world frame, m. [M, 2]."""
    shown = trajectories.select(trajectories.time_s <= trajectories.time_s.min(initial=np.inf) + shown_s)
    return [shown.position[rows] for rows in shown.by_track()]


@styled
def arrangement_figure(scene: Scene, shown_s: float) -> Figure:
    """The obstacles of a scene and the tracks of its first `shown_s` seconds."""
    turns = quarter_turns_of(scene.camera)
    _, (left, right, bottom, top) = obstacle_image(scene.occupancy, turns)
    width = 3.6
    figure = blank(width, 0.35 + width * (top - bottom) / (right - left))
    axes = figure.subplots()
    draw_ground(axes, scene.occupancy, turns)
    draw_tracks(axes, [turn_points(path, turns) for path in first_paths(scene.trajectories, shown_s)])
    return figure


@styled
def contact_sheet(scenes: Sequence[Scene], shown_s: float, columns: int) -> Figure:
    """Many scenes row by row at one scale, each with the tracks of its first `shown_s` seconds."""
    pitch = np.max([scene.occupancy.extent_m for scene in scenes], axis=0) + _GAP_M
    rows = -(-len(scenes) // columns)
    figure = blank(_SHEET_IN, _SHEET_IN * rows * pitch[1] / (columns * pitch[0]))
    axes = figure.subplots()
    for index, scene in enumerate(scenes):
        corner = pitch * [index % columns, rows - 1 - index // columns]
        (left, low), (right, top) = corner, corner + scene.occupancy.extent_m
        image = scene.occupancy.occupied.T
        axes.imshow(image, extent=(left, right, low, top), interpolation="antialiased", **_OBSTACLES)
        shift, paths = corner - scene.occupancy.origin, first_paths(scene.trajectories, shown_s)
        draw_tracks(axes, [path + shift for path in paths], width=3.0 / max(columns, 3))
    width, height = pitch * [columns, rows] - _GAP_M
    axes.set(xlim=(0.0, width), ylim=(0.0, height), aspect="equal")
    axes.set_axis_off()
    return figure
