"""The static obstacles of a place as a grid of square cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.errors import ShapeError, ValueRuleError

_FREE_CELL_M = 0.1
"""Least side of a cell of a map without obstacles."""

_FREE_CELLS = 1000
"""Largest number of cells per side of such a map, so that one stray position does not need gigabytes."""


@dataclass(frozen=True)
class OccupancyMap:
    """Which cells of the ground are blocked. The ground outside the map is free.

    Attributes:
        occupied: cell (i, j) spans origin + resolution * [i, i+1) x [j, j+1). [X, Y] bool
        origin: outer corner of cell (0, 0), world frame, m. [2]
        resolution_m: side of a cell, m.
    """

    occupied: np.ndarray
    origin: np.ndarray
    resolution_m: float

    def __post_init__(self) -> None:
        occupied = np.ascontiguousarray(self.occupied, dtype=bool)
        origin = np.asarray(self.origin, dtype=np.float64)
        if occupied.ndim != 2 or occupied.size == 0:
            raise ShapeError("occupied", occupied.shape, "[X, Y], not empty")
        if origin.shape != (2,):
            raise ShapeError("origin", origin.shape, "(2,)")
        if not np.isfinite(origin).all():
            raise ValueRuleError("origin", origin.tolist(), "it must be finite")
        if not 0 < self.resolution_m < np.inf:
            raise ValueRuleError("resolution_m", self.resolution_m, "it must be positive")
        object.__setattr__(self, "occupied", occupied)
        object.__setattr__(self, "origin", origin)

    @classmethod
    def free_around(cls, points: np.ndarray, margin_m: float = 1.0) -> OccupancyMap:
        """Make a map without obstacles, for a place with unknown ones.

        Args:
            points: the map contains these, world frame, m. [M, 2]
            margin_m: ground around them, m.
        """
        ends = points if len(points) else np.zeros((1, 2))
        low, high = ends.min(axis=0) - margin_m, ends.max(axis=0) + margin_m
        resolution_m = max(_FREE_CELL_M, float((high - low).max()) / _FREE_CELLS)
        shape = np.ceil((high - low) / resolution_m).astype(np.int64)
        return cls(np.zeros(shape, bool), low, resolution_m)

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
