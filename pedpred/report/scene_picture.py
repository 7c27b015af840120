"""A scene at one instant with its forecasts, seen from above or by the camera."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, cast

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch
from matplotlib.projections.polar import PolarAxes

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.metrics.calibration import negative_log_likelihood, radius2, shown_steps, squared_mahalanobis
from pedpred.report.canvas import INK, blank, styled
from pedpred.report.crops import draw_angular_grid, draw_grid
from pedpred.report.instants import Instant
from pedpred.report.methods import Method, Methods
from pedpred.report.plan import draw_ground, extent_around, obstacle_image, quarter_turns_of, turn_points
from pedpred.scenes import Camera, Predictions, Scene

ARROW_S = 0.75
"""Time that a velocity arrow spans, s."""
REGION = 0.9
"""Share of the probability that the drawn regions hold."""
WIDEST = 5.0
"""Width of a mode of weight 1; others are drawn by the root of theirs, points."""
_BYSTANDER = "#8A8A8A"
_MARGIN_M = 2.0
"""Ground shown around people and their paths, m."""
_PALE = 0.42
"""Share of the camera picture's contrast that is kept, so that what is drawn on it stands out."""
_CORNERS, _CELLS = 40, 120
_SPREADS = 3.5
"""Standard deviations around each mode in which its region is searched."""

Projection = Callable[[np.ndarray], np.ndarray]
"""From world points (m, [..., 2]) to the axes' (horizontal, vertical). [..., 2]"""


@styled
def snapshot_figure(scene: Scene, windows: EvaluationWindows, instant: Instant, methods: Methods) -> Figure:
    """Draw the crowd from above, beside the camera's picture if there is one, and inputs about one person."""
    camera, shown = scene.camera, (methods.main, methods.reference)
    height = 6.0 if camera is None else 4.2
    widths = [height, 0.55 * height]
    if camera is not None:
        rows, columns = camera.picture.shape[:2]
        widths = [height * columns / rows, *widths]
    figure = blank(sum(widths) + 0.3, height + 0.5)
    layout = figure.add_gridspec(2, len(widths), width_ratios=widths)
    if camera is not None:
        camera_picture(figure.add_subplot(layout[:, 0]), scene, camera, instant, windows, shown)
    scene_picture(figure.add_subplot(layout[:, -2]), scene, instant, windows, shown)
    draw_grid(figure.add_subplot(layout[0, -1]), windows.grid(instant.focus), windows.grid_resolution_m)
    polar = cast(PolarAxes, figure.add_subplot(layout[1, -1], projection="polar"))
    draw_angular_grid(polar, windows.angular_grid_m[instant.focus], windows.max_range_m)
    above = "" if camera is None else "; the same from above"
    title = f"Scene {scene.name}{above}; right: the LSTM's inputs for person {instant.who}"
    figure.suptitle(title, x=0.01, ha="left", fontsize=10)
    figure.legend(handles=legend_handles(shown), loc="outside upper right", ncols=3)
    return figure


def scene_picture(
    axes: Axes,
    scene: Scene,
    instant: Instant,
    windows: EvaluationWindows,
    methods: Sequence[Method],
    shown: Sequence[float] | None = None,
) -> None:
    """Draw the plan of a scene at an instant, turned like its camera's picture; see `draw_people`.

    Args:
        axes: to draw into.
        scene: whose obstacles and people are drawn.
        instant: the time, and the person in focus.
        windows: of the scene, with the forecasts.
        methods: whose forecasts are drawn, the main one first.
        shown: left, right, bottom and top of the part to show, in the plan, m; by default the surroundings of
            the people and their paths.
    """
    turns = quarter_turns_of(scene.camera)
    if shown is None:
        points, whole = (
            drawn_points(windows, instant.rows, methods),
            obstacle_image(scene.occupancy, turns)[1],
        )
        shown = extent_around(turn_points(points, turns), _MARGIN_M, whole)
    draw_ground(axes, scene.occupancy, turns, shown)
    draw_people(axes, scene, instant, windows, methods, partial(turn_points, quarter_turns=turns))


def camera_picture(
    axes: Axes,
    scene: Scene,
    camera: Camera,
    instant: Instant,
    windows: EvaluationWindows,
    methods: Sequence[Method],
) -> None:
    """Draw a scene at an instant into a pale picture of its camera; see `scene_picture`."""
    rows, columns = camera.picture.shape[:2]
    axes.imshow(lighten(camera.picture), cmap="gray", vmin=0, vmax=255)
    image = camera.homography.to_image
    draw_people(axes, scene, instant, windows, methods, lambda points: image(points)[..., ::-1])
    axes.set(xticks=[], yticks=[], xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
    axes.spines[:].set_visible(False)


def lighten(picture: np.ndarray) -> np.ndarray:
    """Turn a colour picture into light grey in a few steps (small files): [rows, columns] uint8."""
    grey = picture.astype(np.float64) @ [0.299, 0.587, 0.114]
    return (255 - _PALE * (255 - np.round(grey / 12) * 12)).astype(np.uint8)


def draw_people(
    axes: Axes,
    scene: Scene,
    instant: Instant,
    windows: EvaluationWindows,
    methods: Sequence[Method],
    project: Projection,
) -> None:
    """Draw circles with ids, velocity arrows, the true paths dashed, a dot per predicted step.

    The first method gets large dots and, for the person in focus, its modes and regions; others get thin
    lines with small dots. People without an evaluation window (too short a past or future) are empty grey
    circles.
    """
    _draw_bystanders(axes, scene, instant, windows, project)
    for path in _with_present(windows, windows.truth[instant.rows], instant.rows):
        axes.plot(*project(path).T, color=INK, linewidth=1.1, dashes=(4, 2), zorder=3)
    _draw_modes(axes, windows, instant.focus, methods[0], project)
    for rank, method in reversed(list(enumerate(methods))):
        size, width = (4.2, 0.9) if rank == 0 else (2.2, 0.8)
        for path in _with_present(windows, windows.predictions[method.key].point[instant.rows], instant.rows):
            at = project(path)
            axes.plot(*at.T, color=method.colour, linewidth=width, zorder=4 + (rank == 0))
            dots = axes.plot(*at[1:].T, "o", color=method.colour, markersize=size, zorder=5 + (rank == 0))
            dots[0].set_markeredgewidth(0)
    for row in instant.rows:
        step = np.array([[0.0], [ARROW_S]]) * windows.world_velocity[row]
        ends = project(windows.position[row] + step)
        _draw_person(axes, ends, str(windows.track_id[row]), row == instant.focus)


def _draw_bystanders(
    axes: Axes, scene: Scene, instant: Instant, windows: EvaluationWindows, project: Projection
) -> None:
    seen, stamps = scene.trajectories, np.unique(scene.trajectories.time_s)
    nearest_s = stamps[np.argmin(np.abs(stamps - instant.time_s))]
    here = (seen.time_s == nearest_s) & ~np.isin(seen.track_id, windows.track_id[instant.rows])
    if here.any():
        x, y = project(seen.position[here]).T
        axes.scatter(x, y, s=70, facecolors="white", edgecolors=_BYSTANDER, linewidths=1.2, zorder=2)


def _draw_modes(
    axes: Axes, windows: EvaluationWindows, row: int, method: Method, project: Projection
) -> None:
    """Draw a line per mode, wider for larger weights; regions of `REGION` at half the horizon and its end."""
    colour, predictions = method.colour, windows.predictions[method.key]
    if predictions.modes > 1:
        paths = _with_present(windows, predictions.path[row], np.full(predictions.modes, row))
        for path, weight in zip(paths, predictions.weight[row], strict=True):
            width, alpha = WIDEST * np.sqrt(weight), 0.25 + 0.5 * weight
            axes.plot(*project(path).T, color=colour, linewidth=width, alpha=alpha, zorder=3)
    style: dict[str, Any] = {"facecolor": to_rgba(colour, 0.1), "edgecolor": to_rgba(colour, 0.5)}
    for step in shown_steps(predictions.steps)[1:] if predictions.covariance is not None else ():
        for outline in region_outlines(predictions, row, step, REGION):
            axes.fill(*project(outline).T, linewidth=0.6, zorder=2, **style)


def region_outlines(predictions: Predictions, row: int, step: int, share: float) -> list[np.ndarray]:
    """Closed outlines of the smallest region that holds a share of a forecast position, m. [corners, 2] each.

    An ellipse of a single Gaussian; of several modes, a contour of their density.
    """
    assert predictions.covariance is not None
    centre, covariance, weight = (
        predictions.path[row, :, step],
        predictions.covariance[row, :, step],
        predictions.weight[row],
    )
    if predictions.modes == 1:
        return [ellipse_outline(centre[0], covariance[0], share)]
    reach = _SPREADS * np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    x, y = np.linspace((centre - reach).min(axis=0), (centre + reach).max(axis=0), _CELLS).T
    points = np.stack(np.meshgrid(x, y), axis=-1)
    distance2 = squared_mahalanobis(points[..., None, :] - centre, covariance)
    density = np.exp(-negative_log_likelihood(distance2, covariance)) @ weight
    ranked = np.sort(density, axis=None)[::-1]
    level = ranked[np.searchsorted(np.cumsum(ranked), share * ranked.sum())]
    return list(Figure().subplots().contour(x, y, density, [level]).allsegs[0])


def ellipse_outline(centre: np.ndarray, covariance: np.ndarray, share: float) -> np.ndarray:
    """Closed outline of the region that holds a share of a plane Gaussian: [corners, 2] m.

    Centre [2] in m and covariance [2, 2] in m^2 are in the same frame.
    """
    turn = np.linspace(0.0, 2 * np.pi, _CORNERS)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    return centre + np.sqrt(radius2(share)) * circle @ np.linalg.cholesky(covariance).T


def _draw_person(axes: Axes, ends: np.ndarray, name: str, focus: bool) -> None:
    """Draw a circle at the start of the arrow `ends` ([2, 2], in the axes' coordinates)."""
    style: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 9, "shrinkA": 0, "shrinkB": 0}
    if np.abs(ends[1] - ends[0]).max() > 0:
        axes.add_patch(FancyArrowPatch(*ends, color=INK, linewidth=1.2, zorder=7, **style))
    face = INK if focus else "white"
    axes.scatter(ends[0, 0], ends[0, 1], s=150, facecolors=face, edgecolors=INK, linewidths=1.0, zorder=8)
    text: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 6.2, "clip_on": True}
    axes.text(ends[0, 0], ends[0, 1], name, color="white" if focus else INK, zorder=9, **text)


def drawn_points(windows: EvaluationWindows, rows: np.ndarray, methods: Sequence[Method]) -> np.ndarray:
    """The present, the true path and the point forecasts of some windows, world frame, m: [n, points, 2]."""
    paths = [windows.truth, *(windows.predictions[method.key].point for method in methods)]
    return _with_present(windows, np.concatenate([path[rows] for path in paths], axis=1), rows)


def _with_present(windows: EvaluationWindows, paths: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Paths of some windows ([n, P, 2]), begun at the present position: [n, 1 + P, 2]."""
    return np.concatenate([windows.position[rows, None], paths], axis=1)


def legend_handles(methods: Sequence[Method]) -> list[Artist]:
    """Legend entries of the lines and dots."""
    forecasts = [
        Line2D([], [], color=m.colour, marker="o", markersize=2.2 if rank else 4.2, label=m.label)
        for rank, m in enumerate(methods)
    ]
    return [*forecasts, Line2D([], [], color=INK, linewidth=1.1, dashes=(4, 2), label="truth")]


def reading_of_modes(windows: Iterable[EvaluationWindows], method: Method) -> str:
    """How the modes and regions of a method are drawn, as far as it has any; each part ends in "; "."""
    predictions = [scene.predictions[method.key] for scene in windows if method.key in scene.predictions]
    words = ""
    if any(answer.modes > 1 for answer in predictions):
        words = "lines: its modes for the person in focus, wider for larger weights; "
    if any(answer.covariance is not None for answer in predictions):
        words += f"shaded: that person's {100 * REGION:.0f} % region at half the horizon and at its end; "
    return words
