"""What the network sees of one person: obstacle grid and angular pedestrian grid, forward is up."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.projections.polar import PolarAxes

from pedpred.report.canvas import FAINT, INK, OBSTACLE
from pedpred.storage.windows import CELL_M, RANGE_M

_PERSON = "#D55E00"
_FREE = "#E9EEF3"


def grid_image(grid: np.ndarray) -> np.ndarray:
    """The obstacle grid (forward, left) as an image whose row 0 is at the top: forward up, left left."""
    return grid[::-1, ::-1]


def draw_grid(axes: Axes, grid: np.ndarray) -> None:
    """Obstacle cells in black around the person in the middle, who faces upwards."""
    half_m = CELL_M * len(grid) / 2
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
    """Where angular cells (K) begin and end, counter-clockwise from the heading, rad, as [K + 1]."""
    return np.arange(cells + 1) * 2 * np.pi / cells


def draw_angular_grid(axes: PolarAxes, distance_m: np.ndarray) -> None:
    """Free range in pale, the nearest person of each cone as a coloured arc; the heading is up."""
    edges = angular_cell_edges(len(distance_m))
    middle, width = (edges[:-1] + edges[1:]) / 2, edges[1]
    seen = distance_m < RANGE_M
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(1)
    axes.bar(middle, distance_m, width, color=_FREE, linewidth=0)
    axes.bar(middle[seen], 0.25, width, distance_m[seen] - 0.125, color=_PERSON, linewidth=0)
    axes.set(ylim=(0, RANGE_M), title="angular pedestrian grid [m]", yticks=[2, 4, 6])
    axes.set_yticklabels(["2", "4", "6"], fontsize=7, color=INK)
    axes.set_rlabel_position(200)
    axes.set_xticks(np.arange(4) * np.pi / 2, ["ahead", "left", "behind", "right"], fontsize=8)
    axes.grid(color=FAINT, linewidth=0.5)
    axes.spines["polar"].set_color(FAINT)
