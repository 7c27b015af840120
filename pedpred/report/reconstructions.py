"""Crops of the obstacle grid beside their reconstructions by the auto-encoder.

Windows with obstacles on at least a fiftieth of their cells are ranked by the occupied share of their cells,
and taken at evenly spaced ranks. Agreement is intersection over union of the occupied cells.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from matplotlib.figure import Figure

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.models.lstm.autoencoder import GridAutoencoder, intersection_over_union
from pedpred.report.canvas import FAINT, blank, styled
from pedpred.report.document import Picture, Pictures, Section
from pedpred.report.snapshots import grid_image

SHOWN = 8
"""Number of crops in the picture."""
LEAST_SHARE = 0.02
"""Least share of occupied cells; below it a single cell decides on the agreement."""
MEASURED = 200
"""Number of crops over which the agreement is measured."""


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
