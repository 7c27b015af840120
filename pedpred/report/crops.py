"""The LSTM's inputs about one person as pictures, and the reconstructions of its auto-encoder.

Windows with obstacles on at least a fiftieth of their cells are ranked by the occupied share of their cells,
and taken at evenly spaced ranks. Agreement is intersection over union of the occupied cells.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.projections.polar import PolarAxes

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.models.lstm.autoencoder import GridAutoencoder, intersection_over_union
from pedpred.report.canvas import FAINT, INK, OBSTACLE, blank, styled
from pedpred.report.document import Picture, Pictures, Section

SHOWN = 8
"""Number of crops in the picture."""
LEAST_SHARE = 0.02
"""Least share of occupied cells; below it a single cell decides on the agreement."""
MEASURED = 200
"""Number of crops over which the agreement is measured."""
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


def reconstructions_section(
    autoencoder: GridAutoencoder, windows: Mapping[str, EvaluationWindows]
) -> list[Section]:
    """Draw obstacle grids of places unknown to the auto-encoder; nothing where none has an obstacle."""
    crops = choose_evenly(windows, MEASURED)
    if not len(crops):
        return []
    images, agreement = reconstruct(autoencoder, crops)
    few = np.unique(np.linspace(0, len(crops) - 1, SHOWN).round().astype(int))
    caption = (
        f"Obstacle grids of test places, {len(few)} at evenly spaced ranks of occupied share, and their "
        "reconstructions. Intersection over union of occupied cells: median "
        f"{np.median(agreement):.2f} over {len(crops)} grids chosen likewise."
    )
    figure = reconstructions_figure(crops[few], images[few], agreement[few])
    picture = Picture("reconstructions", caption, figure)
    return [Section("Reconstructions of the auto-encoder", [Pictures([picture])])]


def choose_evenly(scenes: Mapping[str, EvaluationWindows], count: int) -> np.ndarray:
    """Choose crops with enough obstacles at evenly spaced ranks of occupied share: [<= count, G, G] bool."""
    windows = [scenes[name] for name in sorted(scenes)]
    if not windows:
        return np.zeros((0, 0, 0), bool)
    rows = [(scene, row) for scene in windows for row in range(len(scene))]
    occupied = np.concatenate([np.bitwise_count(scene.packed_grid).sum(axis=1) for scene in windows])
    order = np.argsort(occupied, kind="stable")
    order = order[occupied[order] >= LEAST_SHARE * 8 * windows[0].packed_grid.shape[1]]
    if not len(order):
        return np.zeros((0, 0, 0), bool)
    ranks = np.unique(np.linspace(0, len(order) - 1, count).round().astype(int))
    return np.array([scene.grid(row) for scene, row in (rows[index] for index in order[ranks])])


@torch.no_grad()
def reconstruct(network: GridAutoencoder, crops: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reconstruct crops, [S, G, G] bool, one at a time: batches round differently.

    Returns:
        images: about 1 where occupied. [S, G, G]
        agreement: intersection over union of each crop. [S]
    """
    images, agreement = [], []
    for crop in torch.from_numpy(crops.astype(np.float32)):
        image = network(crop[None])
        images.append(image[0].numpy())
        agreement.append(intersection_over_union(crop[None], image))
    return np.array(images), np.array(agreement)


@styled
def reconstructions_figure(crops: np.ndarray, images: np.ndarray, agreement: np.ndarray) -> Figure:
    """Draw a column per crop: truth above, reconstruction below, the agreement over it; forward is up."""
    figure = blank(1.2 * len(crops), 2.9)
    axes = figure.subplots(2, len(crops), squeeze=False)
    for word, shown, row in zip(("input", "reconstruction"), (crops, images), axes, strict=True):
        row[0].set_ylabel(word)
        for image, place in zip(shown, row, strict=True):
            place.imshow(grid_image(image), cmap="gray_r", vmin=0, vmax=1, interpolation="nearest")
            place.set(xticks=[], yticks=[])
            place.spines[:].set(visible=True, color=FAINT)
    for share, place in zip(agreement, axes[1], strict=True):
        place.set_title(f"IoU {share:.2f}", fontsize=8)
    return figure
