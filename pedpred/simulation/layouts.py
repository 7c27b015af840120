"""Layouts: rooms described by shapes in metres, their maps, and places for people and targets in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import ndimage

from pedpred.errors import ValueRuleError
from pedpred.scenes import OccupancyMap
from pedpred.settings import load, positive
from pedpred.simulation.ground import Ground
from pedpred.simulation.settings import CrowdSettings
from pedpred.simulation.shapes import Shape, kind_of, shapes_from

RESOLUTION_M = 0.1
WALL_CELLS = 3  # thickness of the outer walls
_LARGEST_SIDE_M = 200.0


@dataclass(frozen=True)
class Layout:
    """A walled room with obstacles.

    Attributes:
        size_m: free width and depth between the outer walls; (0, 0) is the room's lower left corner. [2]
        shapes: obstacles.
        target_regions: people walk between these shapes; empty: between points all over the room.
    """

    size_m: Sequence[float]
    shapes: Sequence[Shape] = field(default=(), metadata={"parse": shapes_from})
    target_regions: Sequence[Shape] = field(default=(), metadata={"parse": shapes_from})

    def __post_init__(self) -> None:
        sides = positive("size_m", self.size_m, (2,))
        if not (sides >= RESOLUTION_M).all() or not (sides <= _LARGEST_SIDE_M).all():
            rule = f"each side must measure {RESOLUTION_M} to {_LARGEST_SIDE_M} m"
            raise ValueRuleError("size_m", self.size_m, rule)

    def occupancy(self) -> OccupancyMap:
        """The map: outer walls, and every cell whose centre lies inside a shape."""
        room = self.empty()
        occupied = room.occupied.copy()
        for shape in self.shapes:
            occupied |= covered(shape, room)
        return OccupancyMap(occupied, room.origin, room.resolution_m)

    def empty(self) -> OccupancyMap:
        """The map with the outer walls only."""
        cells = np.round(np.array(self.size_m) / RESOLUTION_M).astype(int)
        walls = np.pad(np.zeros(cells, dtype=bool), WALL_CELLS, constant_values=True)
        return OccupancyMap(walls, np.full(2, -WALL_CELLS * RESOLUTION_M), RESOLUTION_M)


def covered(shape: Shape, room: OccupancyMap) -> np.ndarray:
    """Cells of a map whose centres lie inside a shape. [X, Y] bool."""
    cells = np.zeros(room.occupied.shape, dtype=bool)
    (left, low), (right, high) = room.cell_of(shape.bounds()).clip(0, np.array(cells.shape) - 1)
    around = np.mgrid[left : right + 1, low : high + 1]
    cells[left : right + 1, low : high + 1] = shape.covers(room.center_of(np.moveaxis(around, 0, -1)))
    return cells


def layout_from(plain: Any, path: str) -> Layout:
    """Parse a layout, as in `conf/layouts`.

    Args:
        plain: `size_m`, optional `shapes` and `target_regions`.
        path: of the layout, for errors.

    Raises:
        ValueRuleError: a field is unknown, missing or breaks its rule, or a shape covers no cell of the room.
    """
    layout: Layout = load(Layout, plain, path)
    room = layout.empty()
    for name in ("shapes", "target_regions"):
        for n, shape in enumerate(getattr(layout, name)):
            if not (covered(shape, room) & ~room.occupied).any():
                rule = f"it covers no {RESOLUTION_M} m cell between (0, 0) and {tuple(layout.size_m)}"
                raise ValueRuleError(f"{path}.{name}[{n}].{kind_of(shape)}", shape, rule)
    return layout


@dataclass(frozen=True)
class TargetPool:
    """Targets of the people in a room.

    Attributes:
        position: world frame, m. [G, 2]
        region: of each target; successive targets lie in different regions. [G]
    """

    position: np.ndarray
    region: np.ndarray


def largest_part(cells: np.ndarray) -> np.ndarray:
    """Largest connected part of a mask [X, Y]; empty if the mask is. [X, Y] bool."""
    labels, count = ndimage.label(cells)
    if count == 0:
        return np.zeros(cells.shape, dtype=bool)
    sizes = np.bincount(labels.ravel())
    return labels == 1 + int(np.argmax(sizes[1:]))


def open_cells(ground: Ground, clearance_m: float) -> np.ndarray:
    """Centres of the walkable cells, the largest connected part with that clearance, m. [C, 2]."""
    cells = np.argwhere(largest_part(ground.distance >= clearance_m))
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


def draw_targets(
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
