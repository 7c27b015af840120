"""Free places on a map: starting positions and targets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from pedpred.errors import ValueRuleError
from pedpred.simulation.ground import Ground
from pedpred.simulation.layouts import Layout
from pedpred.simulation.settings import CrowdSettings


@dataclass(frozen=True)
class TargetPool:
    """Targets of the people in a room.

    Attributes:
        position: world frame, m. [G, 2]
        region: of each target; successive targets lie in different regions. [G]
    """

    position: np.ndarray
    region: np.ndarray


def walkable(distance: np.ndarray, clearance_m: float) -> np.ndarray:
    """Largest connected part of the cells with some clearance. [X, Y] bool."""
    return largest_part(distance >= clearance_m)


def largest_part(cells: np.ndarray) -> np.ndarray:
    """Largest connected part of a mask [X, Y]; empty if the mask is. [X, Y] bool."""
    labels, count = ndimage.label(cells)
    if count == 0:
        return np.zeros(cells.shape, dtype=bool)
    sizes = np.bincount(labels.ravel())
    return labels == 1 + int(np.argmax(sizes[1:]))


def open_cells(ground: Ground, clearance_m: float) -> np.ndarray:
    """Centres of the walkable cells, world frame, m. [C, 2]."""
    cells = np.argwhere(walkable(ground.distance, clearance_m))
    return ground.origin + (cells + 0.5) * ground.resolution_m


def scattered(candidates: np.ndarray, count: int, spacing_m: float, rng: np.random.Generator) -> np.ndarray:
    """Choose up to `count` of the points (m, [C, 2]) at random, at least `spacing_m` apart."""
    chosen = np.empty((0, 2))
    for point in rng.permutation(candidates):
        if len(chosen) == count:
            break
        if not len(chosen) or np.linalg.norm(chosen - point, axis=1).min() >= spacing_m:
            chosen = np.vstack([chosen, point])
    return chosen


def drawn_targets(
    layout: Layout, ground: Ground, settings: CrowdSettings, rng: np.random.Generator
) -> TargetPool:
    """Draw a layout's pool of targets: from its target regions, or from the whole room.

    Raises:
        ValueRuleError: the layout or one of its target regions has no walkable ground.
    """
    cells = open_cells(ground, settings.clearance_m)
    regions = [region.covers(cells) for region in layout.target_regions]
    drawn = []
    for index, mask in enumerate(regions or [np.ones(len(cells), dtype=bool)]):
        count = -(-settings.targets // max(len(regions), 1))
        drawn.append(scattered(cells[mask], count, settings.target_spacing_m, rng))
        if not len(drawn[-1]):
            raise ValueRuleError(f"target_regions[{index}]", len(cells), "it has no walkable ground")
    position = np.concatenate(drawn)
    region = np.repeat(np.arange(len(drawn)), [len(part) for part in drawn])
    return TargetPool(position, region if regions else np.arange(len(position)))
