"""Maps that are turned about the vertical."""

from __future__ import annotations

import math

import numpy as np

from pedpred.compiled import compiled
from pedpred.geometry import rotate
from pedpred.scenes import OccupancyMap
from pedpred.scenes.occupancy import check_cells

_POINTS = 3
"""Points per side of a cell at which a turned map is looked up."""
_MIDDLE = _POINTS // 2
_NO_CELL = 1e-6
"""Share of a cell that is no cell."""


def turned_map(straight: OccupancyMap, yaw_rad: float) -> OccupancyMap:
    """The smallest map along the axes that holds a turned one; a cell that a blocked one touches is blocked.

    Takes one look-up for each of at most `MOST_PIXELS` cells, and `_POINTS`^2 for those near blocked ones.

    Args:
        straight: the map before it is turned about its origin.
        yaw_rad: counter-clockwise.
    """
    blocked, origin, side_m = straight.occupied, straight.origin, straight.resolution_m
    size_m = straight.extent_m
    corners = np.array([[0.0, 0.0], [size_m[0], 0.0], [0.0, size_m[1]], size_m])
    corners = origin + rotate(corners, np.full(4, yaw_rad))
    low, high = corners.min(axis=0), corners.max(axis=0)
    shape = np.ceil((high - low) / side_m - _NO_CELL).astype(np.int64)
    check_cells(*shape.tolist())
    occupied = np.zeros(shape, bool)
    (x, y) = (
        ((np.arange(n * _POINTS) + 0.5) / _POINTS + (end - origin[axis]) / side_m).reshape(n, _POINTS)
        for axis, (n, end) in enumerate(zip(shape, low, strict=True))
    )
    padded = np.zeros(np.array(blocked.shape) + 2, bool)
    padded[1:-1, 1:-1] = blocked
    _look_up(padded, _with_neighbours(padded), x, y, math.cos(yaw_rad), math.sin(yaw_rad), occupied)
    return OccupancyMap(occupied, low, side_m)


def warm_up_turning() -> None:
    """Compile the loop that turns maps, unless kept."""
    turned_map(OccupancyMap(np.ones((1, 1), bool), np.zeros(2), 1.0), 0.1)


def _with_neighbours(padded: np.ndarray) -> np.ndarray:
    """Blocked cells and all that touch them; see `_look_up`. [X + 2, Y + 2] bool."""
    wide = padded.copy()
    wide[1:] |= padded[:-1]
    wide[:-1] |= padded[1:]
    near = wide.copy()
    near[:, 1:] |= wide[:, :-1]
    near[:, :-1] |= wide[:, 1:]
    return near


@compiled
def _look_up(padded, near, x, y, cos, sin, occupied):  # pragma: no cover (compiled)
    """Write which cells a blocked one touches into `occupied`.

    Args:
        padded: which cells are blocked, with a rim of one cell. [X + 2, Y + 2] bool
        near: see `_with_neighbours`; points of a cell are nearer than a cell to its middle. [X + 2, Y + 2]
        x: of the points in each column of `occupied`, in cells from the corner of the map. [A, _POINTS]
        y: of those in each row. [B, _POINTS]
        cos: of the angle by which the map is turned.
        sin: of it.
        occupied: [A, B] bool
    """
    width, height = near.shape
    for a in range(len(x)):
        for b in range(len(y)):
            i = math.floor(cos * x[a, _MIDDLE] + sin * y[b, _MIDDLE]) + 1
            j = math.floor(cos * y[b, _MIDDLE] - sin * x[a, _MIDDLE]) + 1
            if 0 <= i < width and 0 <= j < height and near[i, j]:
                occupied[a, b] = _touched(padded, x[a], y[b], cos, sin)


@compiled
def _touched(padded, x, y, cos, sin):  # pragma: no cover (compiled)
    """Whether a point of one cell lies in a blocked one."""
    width, height = padded.shape
    for p in range(_POINTS):
        for q in range(_POINTS):
            i = math.floor(cos * x[p] + sin * y[q]) + 1
            j = math.floor(cos * y[q] - sin * x[p]) + 1
            if 0 <= i < width and 0 <= j < height and padded[i, j]:
                return True
    return False
