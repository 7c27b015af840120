"""The static obstacles around a pedestrian, turned with it (Pfeiffer et al. 2018, III-B)."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from pedpred.scenes import OccupancyMap


def occupancy_crops(
    occupancy: OccupancyMap, position: np.ndarray, heading_rad: np.ndarray, cells: int, resolution_m: float
) -> np.ndarray:
    """Bit-packed square crops of the map, one per pose.

    Cell (i, j) of a crop is the map's cell under the point
    ((i + 1/2) - cells/2, (j + 1/2) - cells/2) * resolution_m of the agent frame (forward, left).
    Outside the map is free.

    Args:
        occupancy: static obstacles.
        position: world frame, m. [Q, 2]
        heading_rad: direction of the agent's x axis. [Q]
        cells: cells per side of the crop; cells * cells must be a multiple of 8.
        resolution_m: side of a crop cell, m.

    Returns:
        Rows of bits, cell (i, j) is bit (i * cells + j), least significant first. [Q, cells^2 / 8] uint8
    """
    crops = np.zeros((len(position), cells * cells // 8), dtype=np.uint8)
    scale = 1.0 / occupancy.resolution_m
    start = (np.asarray(position, dtype=np.float64) - occupancy.origin) * scale
    _crop(occupancy.occupied, start, np.asarray(heading_rad, np.float64), cells, resolution_m * scale, crops)
    return crops


@njit(parallel=True, cache=True)
def _crop(occupied, start, heading_rad, cells, step, crops):  # pragma: no cover (compiled)
    """`start` and `step` are in map cells. Writes into `crops`."""
    size_x, size_y = occupied.shape
    for q in prange(len(start)):
        cos, sin = np.cos(heading_rad[q]) * step, np.sin(heading_rad[q]) * step
        for i in range(cells):
            forward = i + 0.5 - 0.5 * cells
            for j in range(cells):
                left = j + 0.5 - 0.5 * cells
                x = start[q, 0] + cos * forward - sin * left
                y = start[q, 1] + sin * forward + cos * left
                if 0.0 <= x < size_x and 0.0 <= y < size_y and occupied[int(x), int(y)]:
                    bit = i * cells + j
                    crops[q, bit >> 3] |= np.uint8(1 << (bit & 7))
