"""Obstacles on a grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pedpred.arrays import read_only, real_number, real_numbers
from pedpred.errors import ValueRuleError, shape_error
from pedpred.files import MOST_PIXELS

FARTHEST_M = 1e8
"""Coordinates are at most this far from the origin: farther than in any map projection of the Earth, m."""

_SMALLEST_CELL_M = 1e-6
_FREE_CELL_M = 0.1
"""Least side of a cell of a map without obstacles."""

_FREE_CELLS = 1000
"""Largest number of cells per side of such a map, so that one stray position does not need gigabytes."""


@dataclass(frozen=True)
class OccupancyMap:
    """Which cells of the ground are blocked. The ground outside the map is free.

    A map never changes: its arrays are read-only, and copies of arrays that could be written into.

    Attributes:
        occupied: cell (i, j) spans origin + resolution * [i, i+1) x [j, j+1). True or 1: blocked. At most
            `MOST_PIXELS` cells. [X, Y] bool
        origin: outer corner of cell (0, 0), world frame, m, at most `FARTHEST_M` from 0. [2]
        resolution_m: side of a cell, m.

    Raises:
        ValueRuleError: the map is empty, has too many cells or another number of axes; or a cell is neither
            blocked nor free, such as -1 (unknown) or a probability.
    """

    occupied: np.ndarray
    origin: np.ndarray
    resolution_m: float

    def __post_init__(self) -> None:
        occupied = _blocked(self.occupied)
        origin = read_only(real_numbers("origin", self.origin), float)
        if origin.shape != (2,):
            raise shape_error("origin", origin.shape, "(2,)")
        if not (np.abs(origin) <= FARTHEST_M).all():
            raise ValueRuleError("origin", origin.tolist(), f"it must be within {FARTHEST_M:g} m of 0")
        object.__setattr__(self, "resolution_m", real_number("resolution_m", self.resolution_m))
        _check_side("resolution_m", self.resolution_m)
        object.__setattr__(self, "occupied", occupied)
        object.__setattr__(self, "origin", origin)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the arrays of a map that another process sent read-only, as they were there."""
        for values in state.values():
            if isinstance(values, np.ndarray):
                values.flags.writeable = False
        self.__dict__.update(state)

    @classmethod
    def free_around(cls, points: np.ndarray, cell_m: float = _FREE_CELL_M) -> OccupancyMap:
        """Make a map without obstacles, for a place with unknown ones: 1 m of ground around some points.

        Args:
            points: the map contains these, world frame, m. [M, 2]
            cell_m: side of a cell, larger where there would be too many, m.
        """
        ends = points if len(points) else np.zeros((1, 2))
        low, high = ends.min(axis=0) - 1.0, ends.max(axis=0) + 1.0
        resolution_m = max(cell_m, float((high - low).max()) / _FREE_CELLS)
        shape = np.ceil((high - low) / resolution_m).astype(np.int64)
        return cls(np.zeros(shape, bool), low, resolution_m)

    def free(self, cell_m: float) -> OccupancyMap:
        """Make a map of the same ground without obstacles, in cells of another size."""
        _check_side("cell_m", cell_m)
        shape = np.ceil(self.extent_m / cell_m - 1e-9).astype(np.int64)
        check_cells(*shape.tolist())
        return OccupancyMap(np.zeros(shape, bool), self.origin, cell_m)

    @property
    def extent_m(self) -> np.ndarray:
        """Size along x and y, m, [2]."""
        return np.array(self.occupied.shape) * self.resolution_m

    def cell_of(self, points: np.ndarray) -> np.ndarray:
        """Indices (i, j) of the cells that hold world points; may lie outside, [..., 2] int."""
        relative = (np.asarray(points, dtype=np.float64) - self.origin) / self.resolution_m
        return np.floor(relative).astype(np.int64)

    def center_of(self, cells: np.ndarray) -> np.ndarray:
        """World positions of cell centres, m, [..., 2]."""
        return self.origin + (np.asarray(cells) + 0.5) * self.resolution_m

    def is_occupied(self, points: np.ndarray) -> np.ndarray:
        """Whether world points (m, [..., 2]) lie in an occupied cell; outside is free. Bool, [...]."""
        cells = self.cell_of(points)
        inside = np.asarray(((cells >= 0) & (cells < self.occupied.shape)).all(axis=-1))
        cells = np.where(inside[..., None], cells, 0)
        return inside & self.occupied[cells[..., 0], cells[..., 1]]


def _check_side(field: str, side_m: float) -> None:
    if not _SMALLEST_CELL_M <= side_m <= FARTHEST_M:
        raise ValueRuleError(field, side_m, f"it must be between {_SMALLEST_CELL_M} and {FARTHEST_M:g} m")


def check_cells(width: int, height: int) -> None:
    """Check the size of a map before its cells are decoded.

    Raises:
        ValueRuleError: it is empty or has more than `MOST_PIXELS` cells.
    """
    if not (width > 0 and height > 0 and width * height <= MOST_PIXELS):
        raise shape_error("occupied", (width, height), f"[X, Y], not empty, at most {MOST_PIXELS} cells")


def _blocked(values: Any) -> np.ndarray:
    """Cells as bool, after a check that each is clearly blocked or free."""
    cells = real_numbers("occupied", values, "biuf")
    if cells.ndim != 2:
        raise shape_error("occupied", cells.shape, "[X, Y]")
    check_cells(*cells.shape)
    if cells.dtype != bool:
        clear = (cells == 0) | (cells == 1)
        if not clear.all():
            row, column = np.argwhere(~clear)[0].tolist()
            rule = "cells are 1 (blocked) or 0 (free): decide about others first, such as `grid > 50`"
            raise ValueRuleError(f"occupied[{row}, {column}]", cells[[row], [column]].tolist()[0], rule)
    return read_only(cells, bool)
