"""The plan view: obstacles, people, forecasts and tracks seen from above, in metres."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, to_rgba
from matplotlib.figure import Figure

from pedpred.geometry import rotate
from pedpred.report.canvas import FAINT, INK, OBSTACLE, blank, styled
from pedpred.scenes import Camera, OccupancyMap, Recording, Scene

_TRACK_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F")
_BLACK_ON_CLEAR = ListedColormap([(0.0, 0.0, 0.0, 0.0), to_rgba(OBSTACLE)])


def turned(points: np.ndarray, quarter_turns: int) -> np.ndarray:
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
    corners = turned(np.array([occupancy.origin, occupancy.origin + occupancy.extent_m]), quarter_turns)
    (left, bottom), (right, top) = corners.min(axis=0), corners.max(axis=0)
    return image, (float(left), float(right), float(bottom), float(top))


def draw_ground(axes: Axes, occupancy: OccupancyMap, quarter_turns: int) -> None:
    """Obstacle cells in black, a frame around the map, and a bar of two metres instead of axes."""
    image, extent = obstacle_image(occupancy, quarter_turns)
    style: dict[str, Any] = {"cmap": _BLACK_ON_CLEAR, "vmin": 0, "vmax": 1, "interpolation": "nearest"}
    axes.imshow(image, extent=extent, origin="lower", **style)
    axes.set(xticks=[], yticks=[], aspect="equal", xlim=extent[:2], ylim=extent[2:])
    axes.spines[:].set(visible=True, color=FAINT)
    below = extent[2] - 0.035 * (extent[3] - extent[2])
    axes.plot([extent[0], extent[0] + 2.0], [below, below], color=INK, linewidth=2, clip_on=False)
    axes.text(extent[0] + 2.3, below, "2 m", va="center", fontsize=8)


def draw_tracks(axes: Axes, recording: Recording, quarter_turns: int, width: float = 0.7) -> None:
    """One thin line per track; colours only tell neighbours apart."""
    order = np.lexsort((recording.time_s, recording.track_id))
    starts = np.flatnonzero(np.diff(recording.track_id[order])) + 1
    lines = np.split(turned(recording.position[order], quarter_turns), starts)
    colour = [_TRACK_COLOURS[k % len(_TRACK_COLOURS)] for k in range(len(lines))]
    axes.add_collection(LineCollection(lines, colors=colour, linewidths=width, alpha=0.6))


@styled
def arrangement_figure(scene: Scene, shown_s: float) -> Figure:
    """The obstacles of a scene and the tracks of its first `shown_s` seconds."""
    turns = quarter_turns_of(scene.camera)
    _, (left, right, bottom, top) = obstacle_image(scene.occupancy, turns)
    width = 3.6
    figure = blank(width, 0.35 + width * (top - bottom) / (right - left))
    axes = figure.subplots()
    draw_ground(axes, scene.occupancy, turns)
    time_s = scene.recording.time_s
    if len(time_s):
        draw_tracks(axes, scene.recording.select(time_s <= time_s.min() + shown_s), turns)
    return figure
