"""Figures of one instant: a crowd or a camera view beside its plan, and the inputs about one person."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.projections.polar import PolarAxes

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.report.canvas import FAINT, INK, OBSTACLE, blank, styled
from pedpred.report.instants import Instant
from pedpred.report.methods import Methods
from pedpred.report.scene_picture import camera_picture, legend_handles, scene_picture
from pedpred.scenes import Scene

_FREE = "#E9EEF3"


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


def grid_image(grid: np.ndarray) -> np.ndarray:
    """Turn the obstacle grid (forward, left) into an image with row 0 at the top: forward up, left left."""
    return grid[::-1, ::-1]


def draw_grid(axes: Axes, grid: np.ndarray, resolution_m: float) -> None:
    """Draw obstacle cells of `resolution_m` in black around the person in the middle, who faces upwards."""
    half_m = resolution_m * len(grid) / 2
    palette = ListedColormap(["white", OBSTACLE])
    extent = (-half_m, half_m, -half_m, half_m)
    axes.imshow(grid_image(grid), extent=extent, cmap=palette, vmin=0, vmax=1, interpolation="nearest")
    halo = [withStroke(linewidth=4, foreground="white")]  # seen on obstacles, too
    arrow: dict[str, Any] = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.5, "path_effects": halo}
    axes.annotate("", (0, 0.9), (0, 0), arrowprops=arrow)
    axes.plot(0, 0, marker="o", markersize=6, color=INK, path_effects=halo)
    axes.set(xticks=[-half_m, 0, half_m], yticks=[-half_m, 0, half_m], title="obstacle grid [m]")
    axes.set_xticklabels([f"{half_m:g} left", "", f"{half_m:g} right"])
    axes.set_yticklabels([f"{half_m:g} behind", "", f"{half_m:g} ahead"])
    axes.spines[:].set(visible=True, color=FAINT)


def draw_angular_grid(axes: PolarAxes, distance_m: np.ndarray, range_m: float) -> None:
    """Draw the free range pale and the nearest person of each cone as a dark arc; the heading is up."""
    edges = np.arange(len(distance_m) + 1) * 2 * np.pi / len(distance_m)
    middle, width = (edges[:-1] + edges[1:]) / 2, edges[1]
    seen = distance_m < range_m
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(1)
    axes.bar(middle, distance_m, width, color=_FREE, linewidth=0)
    axes.bar(middle[seen], 0.25, width, distance_m[seen] - 0.125, color=INK, linewidth=0)
    ticks = [round(range_m * part / 3, 2) for part in (1, 2, 3)]
    axes.set(ylim=(0, range_m), title="angular pedestrian grid [m]", yticks=ticks)
    axes.set_yticklabels([f"{tick:g}" for tick in ticks], fontsize=7, color=INK)
    axes.set_rlabel_position(200)
    axes.set_xticks(np.arange(4) * np.pi / 2, ["ahead", "left", "behind", "right"], fontsize=8)
    axes.grid(color=FAINT, linewidth=0.5)
    axes.spines["polar"].set_color(FAINT)
