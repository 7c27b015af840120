"""The inputs of the network about one person: obstacle grid and angular pedestrian grid, forward is up."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.projections.polar import PolarAxes

from pedpred.report.canvas import FAINT, INK, OBSTACLE

_PERSON = "#D55E00"
_FREE = "#E9EEF3"


def grid_image(grid: np.ndarray) -> np.ndarray:
    """Turn the obstacle grid (forward, left) into an image with row 0 at the top: forward up, left left."""
    return grid[::-1, ::-1]


def draw_grid(axes: Axes, grid: np.ndarray, resolution_m: float) -> None:
    """Draw obstacle cells of `resolution_m` in black around the person in the middle, who faces upwards."""
    half_m = resolution_m * len(grid) / 2
    palette = ListedColormap(["white", OBSTACLE])
    extent = (-half_m, half_m, -half_m, half_m)
    axes.imshow(grid_image(grid), extent=extent, cmap=palette, vmin=0, vmax=1, interpolation="nearest")
    axes.annotate("", (0, 0.9), (0, 0), arrowprops={"arrowstyle": "-|>", "color": _PERSON, "linewidth": 1.5})
    axes.plot(0, 0, marker="o", markersize=6, color=_PERSON)
    axes.set(xticks=[-half_m, 0, half_m], yticks=[-half_m, 0, half_m], title="obstacle grid [m]")
    axes.set_xticklabels([f"{half_m:g} left", "", f"{half_m:g} right"])
    axes.set_yticklabels([f"{half_m:g} behind", "", f"{half_m:g} ahead"])
    axes.spines[:].set(visible=True, color=FAINT)


def angular_cell_edges(cells: int) -> np.ndarray:
    """Edges of the angular cells (K), counter-clockwise from the heading, rad, as [K + 1]."""
    return np.arange(cells + 1) * 2 * np.pi / cells


def draw_angular_grid(axes: PolarAxes, distance_m: np.ndarray, range_m: float) -> None:
    """Draw the free range pale and the nearest person of each cone as a coloured arc; the heading is up."""
    edges = angular_cell_edges(len(distance_m))
    middle, width = (edges[:-1] + edges[1:]) / 2, edges[1]
    seen = distance_m < range_m
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(1)
    axes.bar(middle, distance_m, width, color=_FREE, linewidth=0)
    axes.bar(middle[seen], 0.25, width, distance_m[seen] - 0.125, color=_PERSON, linewidth=0)
    ticks = [round(range_m * part / 3, 2) for part in (1, 2, 3)]
    axes.set(ylim=(0, range_m), title="angular pedestrian grid [m]", yticks=ticks)
    axes.set_yticklabels([f"{tick:g}" for tick in ticks], fontsize=7, color=INK)
    axes.set_rlabel_position(200)
    axes.set_xticks(np.arange(4) * np.pi / 2, ["ahead", "left", "behind", "right"], fontsize=8)
    axes.grid(color=FAINT, linewidth=0.5)
    axes.spines["polar"].set_color(FAINT)
