"""Free places on a map: where people can stand and where they may want to go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from pedpred.errors import ConfigError
from pedpred.simulation.ground import Ground
from pedpred.simulation.layouts import Layout
from pedpred.simulation.settings import CrowdSettings


@dataclass(frozen=True)
class TargetPool:
    """Where people want to go.

    Attributes:
        position: world frame, m. [G, 2]
        region: a target is followed by one of another region. [G]
    """

    position: np.ndarray
    region: np.ndarray


def walkable(distance: np.ndarray, clearance_m: float) -> np.ndarray:
    """The largest connected part of the cells with some clearance. [X, Y] bool."""
    return largest_part(distance >= clearance_m)


def largest_part(cells: np.ndarray) -> np.ndarray:
    """The largest connected part of some cells ([X, Y] bool); none of none. [X, Y] bool."""
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
    """Up to `count` of the candidate points (m, [C, 2]) at random, none closer than `spacing_m`."""
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
    """A layout's pool of targets: from its target regions, or from all over it.

    Raises:
        ConfigError: the layout or one of its target regions has no walkable ground.
    """
    cells = open_cells(ground, settings.clearance_m)
    regions = [region.covers(cells) for region in layout.target_regions]
    drawn = []
    for index, mask in enumerate(regions or [np.ones(len(cells), dtype=bool)]):
        count = -(-settings.targets // max(len(regions), 1))
        drawn.append(scattered(cells[mask], count, settings.target_spacing_m, rng))
        if not len(drawn[-1]):
            raise ConfigError(f"target_regions[{index}]", len(cells), "there is no walkable ground in it")
    position = np.concatenate(drawn)
    region = np.repeat(np.arange(len(drawn)), [len(part) for part in drawn])
    return TargetPool(position, region if regions else np.arange(len(position)))
