"""Occupancy crops: the obstacles around a pedestrian in its own frame (Pfeiffer et al. 2018, III-B)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from pedpred.features.threads import threads_for
from pedpred.scenes import OccupancyMap

_GATHER_BITS = np.uint64(0x0102040810204080)
"""Multiplying a little-endian word of eight bytes 0 or 1 by this collects their bits in its top byte."""


def occupancy_crops(
    occupancy: OccupancyMap, position: np.ndarray, heading_rad: np.ndarray, cells: int, resolution_m: float
) -> np.ndarray:
    """Cut bit-packed square crops out of the map, one per pose.

    Cell (i, j) of a crop is the map cell under the point (f, l) of the agent frame (forward, left),
        f = (i + 1/2 - cells/2) resolution_m,    l = (j + 1/2 - cells/2) resolution_m.
    Ground outside the map is free, so a pedestrian far from it gets an empty crop.

    Args:
        occupancy: static obstacles.
        position: world frame, m. [Q, 2]
        heading_rad: direction of the agent's x axis. [Q]
        cells: cells per side of the crop; cells * cells must be a multiple of 8.
        resolution_m: side of a crop cell, m.

    Returns:
        Rows of bits; cell (i, j) is bit i * cells + j, least significant first. [Q, cells^2 / 8] uint8
    """
    crops = np.empty((len(position), cells * cells // 8), dtype=np.uint8)
    scale = 1.0 / occupancy.resolution_m
    start = (np.asarray(position, dtype=np.float64) - occupancy.origin) * scale
    centers = np.arange(cells) + (0.5 - 0.5 * cells)
    heading_rad = np.asarray(heading_rad, dtype=np.float64)
    with threads_for(len(start)):
        _crop(occupancy.occupied, start, heading_rad, centers, resolution_m * scale, crops)
    return crops


@njit(parallel=True, cache=True)
def _crop(occupied, start, heading_rad, centers, step, crops):  # pragma: no cover (compiled)
    """`start` and `step` are in map cells, `centers` in crop cells. Writes into `crops`.

    The loop over coordinates is vectorised; the look-ups in the map take most of the time.
    """
    size_x, size_y = occupied.shape
    flat = occupied.ravel()
    cells = len(centers)
    for q in prange(len(start)):
        cos, sin = math.cos(heading_rad[q]) * step, math.sin(heading_rad[q]) * step
        found = np.empty(cells * cells, np.uint8)
        index = np.empty(cells, np.int32)
        for i in range(cells):
            row_x = start[q, 0] + cos * centers[i]
            row_y = start[q, 1] + sin * centers[i]
            for j in range(cells):
                x = np.floor(row_x - sin * centers[j])
                y = np.floor(row_y + cos * centers[j])
                inside = (x >= 0.0) & (x < size_x) & (y >= 0.0) & (y < size_y)
                index[j] = np.int32(x * size_y + y if inside else -1.0)
            for j in range(cells):
                found[i * cells + j] = index[j] >= 0 and flat[index[j]]
        words = found.view(np.uint64)
        crops[q] = ((words * _GATHER_BITS) >> np.uint64(56)).astype(np.uint8)
