"""The ground of a world: free cells, entrances, and points on them. The lower left corner is (0, 0)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from pedpred.settings import Range

CELL_M = 0.1
_WALL_CELLS = (2, 5)  # thickness of walls that are drawn as such


class Area(NamedTuple):
    """A rectangle along the axes: where people come in or leave, or what a sensor sees.

    Attributes:
        low: lower left corner, m. [2]
        high: upper right corner, m. [2]
    """

    low: np.ndarray
    high: np.ndarray

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Whether points (m, [..., 2]) are inside. Bool, [...]."""
        return np.asarray(((points >= self.low) & (points <= self.high)).all(axis=-1))


class Floor(NamedTuple):
    """Walkable ground of a world.

    Attributes:
        free: walkable cells of side `CELL_M`. [X, Y] bool
        entrances: of the people; none where they are inside from the start.
        width_m: of the ground in front of the narrowest place.
        narrow_m: width that limits how many people can pass.
        crossed: whether the entrances are four, as (east, west, north, south).
    """

    free: np.ndarray
    entrances: tuple[Area, ...] = ()
    width_m: float = 0.0
    narrow_m: float = 0.0
    crossed: bool = False

    @property
    def size_m(self) -> np.ndarray:
        """Extent along x and y, m. [2]."""
        return np.array(self.free.shape) * CELL_M


def ground_cells(size_m: np.ndarray | Range, free: bool) -> np.ndarray:
    """Cells of a ground of some size that is all free or all blocked. [X, Y] bool."""
    return np.full(np.ceil(np.asarray(size_m) / CELL_M - 1e-9).astype(int), free)


def paint_rectangle(free: np.ndarray, low: np.ndarray | Range, high: np.ndarray | Range, value: bool) -> None:
    """Set the cells of a rectangle; what lies outside the ground is ignored."""
    (left, bottom), (right, top) = (
        np.clip(np.round(np.asarray(end) / CELL_M), 0, free.shape).astype(int) for end in (low, high)
    )
    free[left:right, bottom:top] = value


def paint_disc(free: np.ndarray, center: np.ndarray, radius_m: float) -> None:
    """Block the cells of a disc."""
    cells = (np.moveaxis(np.indices(free.shape), 0, -1) + 0.5) * CELL_M
    free[((cells - center) ** 2).sum(axis=-1) < radius_m**2] = False


def clearance_m(free: np.ndarray) -> np.ndarray:
    """Distance of cell centres to the nearest blocked cell's, m; large where nothing is blocked. [X, Y]."""
    if free.all():
        return np.full(free.shape, np.inf)
    return ndimage.distance_transform_edt(free) * CELL_M


def draw_points(
    free: np.ndarray, area: Area, count: int, clear_m: float, rng: np.random.Generator
) -> np.ndarray:
    """Draw cell centres in a rectangle with some clearance, or what little there is, m. [count, 2]."""
    low = np.floor(area.low / CELL_M + 1e-9).astype(int).clip(0)
    high = np.ceil(area.high / CELL_M - 1e-9).astype(int)
    clearance = clearance_m(free)[low[0] : high[0], low[1] : high[1]]
    cells = np.argwhere(clearance > min(clear_m, 0.9 * clearance.max()))
    return (cells[rng.integers(len(cells), size=count)] + low + 0.5) * CELL_M


def move_onto_free(free: np.ndarray, points: np.ndarray, clear_m: float) -> np.ndarray:
    """Move points with less clearance to the nearest cell that has it; they are clipped to the ground.

    Args:
        free: walkable cells. [X, Y]
        points: m. [M, 2]
        clear_m: least clearance.
    """
    inside = np.clip(points, 0.5 * CELL_M, (np.array(free.shape) - 0.5) * CELL_M)
    narrow = clearance_m(free) <= clear_m
    if not narrow.any() or narrow.all():
        return inside
    nearest = ndimage.distance_transform_edt(narrow, return_distances=False, return_indices=True)
    i, j = np.floor(inside / CELL_M).astype(int).T
    moved = (nearest[:, i, j].T + 0.5) * CELL_M
    return np.where(narrow[i, j][:, None], moved, inside)


def close_openings(occupied: np.ndarray, width_m: float) -> np.ndarray:
    """Occupied cells of a coarse map, or one with closed doors: narrower openings are filled. [X, Y] bool."""
    near = clearance_m(~occupied) <= width_m / 2
    return occupied | (clearance_m(near) > width_m / 2)


def show_on_map(free: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Occupied cells as a map may show them: all that is not walkable, or walls around it. [X, Y] bool."""
    if rng.random() < 0.5:
        return ~free
    thickness = int(rng.integers(_WALL_CELLS[0], _WALL_CELLS[1] + 1))
    return ~free & ndimage.binary_dilation(free, iterations=thickness)
