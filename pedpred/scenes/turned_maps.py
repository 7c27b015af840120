"""Maps that are turned about the vertical axis, as along the axes of another frame."""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from pedpred.geometry import rotate
from pedpred.scenes.occupancy import OccupancyMap, check_cells

_SAMPLES = 3
"""Points per side of a cell at which the turned map is looked up."""
_NO_CELL = 1e-6
"""Share of a cell by which the ground may exceed the last one."""
_BLOCK_CELLS = 2**18


def turned_map(straight: OccupancyMap, yaw_rad: float) -> OccupancyMap:
    """Return the smallest axis-aligned map that holds a turned one.

    A cell is blocked if one of `_SAMPLES`^2 points, evenly spread over it, lies in a blocked cell of the
    turned map.

    Args:
        straight: the map before it is turned about its origin.
        yaw_rad: counter-clockwise, rad.

    Raises:
        ValueRuleError: the map would have more than `MOST_PIXELS` cells.
    """
    origin, side_m = straight.origin, straight.resolution_m
    corners = straight.extent_m * np.array(list(product((0.0, 1.0), repeat=2)))
    corners = origin + rotate(corners, np.full(len(corners), yaw_rad))
    low, high = corners.min(axis=0), corners.max(axis=0)
    shape = np.ceil((high - low) / side_m - _NO_CELL).astype(np.int64)
    check_cells(*shape.tolist())
    x, y = (
        ((np.arange(n * _SAMPLES) + 0.5) / _SAMPLES + start).reshape(n, _SAMPLES)
        for n, start in zip(shape, (low - origin) / side_m, strict=True)
    )
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    blocked = np.pad(straight.occupied, 1)
    near = _with_neighbours(blocked)  # every point of a cell is less than a cell from its middle
    occupied = np.zeros(shape, bool)
    columns, middle = max(1, _BLOCK_CELLS // len(y)), _SAMPLES // 2
    for first in range(0, len(x), columns):
        block = slice(first, first + columns)
        a, b = np.nonzero(_look_up(near, x[block, middle, None], y[:, middle], cos, sin))
        samples = product(x[block][a].T, y[b].T)
        occupied[block][a, b] = np.any([_look_up(blocked, *at, cos, sin) for at in samples], axis=0)
    return OccupancyMap(occupied, low, side_m)


def _look_up(padded: np.ndarray, x: np.ndarray, y: np.ndarray, cos: float, sin: float) -> np.ndarray:
    """Values of cells at points, in cells from the map's origin; `padded` has a rim of one free cell."""
    i = np.floor(cos * x + sin * y).astype(np.int64) + 1
    j = np.floor(cos * y - sin * x).astype(np.int64) + 1
    values: np.ndarray = padded[i.clip(0, padded.shape[0] - 1), j.clip(0, padded.shape[1] - 1)]
    return values


def _with_neighbours(blocked: np.ndarray) -> np.ndarray:
    """Which cells are blocked or touch a blocked one. [X, Y] bool."""
    wide, (width, height) = np.pad(blocked, 1), blocked.shape
    shifted = [wide[i : i + width, j : j + height] for i, j in product(range(3), repeat=2)]
    return np.logical_or.reduce(shifted)
