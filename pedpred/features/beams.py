"""Distances to the nearest obstacle along beams around a pedestrian."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pedpred.scenes import OccupancyMap


def obstacle_distances(
    occupancy: OccupancyMap, position: np.ndarray, heading_rad: np.ndarray, beams: int, range_m: float
) -> np.ndarray:
    """Cast beams into the map, one set per pose; exact for its square cells.

    Beam b points to 2 pi b / beams counter-clockwise from the heading. Ground outside the map is free.

    Args:
        occupancy: static obstacles.
        position: world frame, m. [Q, 2]
        heading_rad: direction of the agent's x axis. [Q]
        beams: number of beams B.
        range_m: largest distance; also the value of a beam that meets nothing, m.

    Returns:
        Distances, m; 0 inside an obstacle. [Q, B] float32
    """
    start = (np.asarray(position, np.float64) - occupancy.origin) / occupancy.resolution_m
    found = np.empty((len(start), beams), np.float32)
    heading_rad = np.asarray(heading_rad, np.float64)
    _cast(occupancy.occupied, start, heading_rad, range_m / occupancy.resolution_m, found)
    found *= np.float32(occupancy.resolution_m)
    return np.minimum(found, np.float32(range_m))


@njit(cache=True, nogil=True)
def _cast(occupied, start, heading_rad, reach, found):  # pragma: no cover (compiled)
    """From cell edge to cell edge (Amanatides & Woo 1987); lengths are in cells. Writes into `found`."""
    size = occupied.shape
    beams = found.shape[1]
    for q in range(len(start)):
        for b in range(beams):
            angle = heading_rad[q] + 2.0 * math.pi * b / beams
            way = (math.cos(angle), math.sin(angle))
            enter, leave = 0.0, reach  # the part of the beam above the map
            for axis in range(2):
                if abs(way[axis]) < 1e-12:
                    if not 0.0 <= start[q, axis] < size[axis]:
                        leave = -1.0
                else:
                    one, other = -start[q, axis] / way[axis], (size[axis] - start[q, axis]) / way[axis]
                    enter, leave = max(enter, min(one, other)), min(leave, max(one, other))
            found[q, b] = reach
            if enter >= leave:
                continue
            x, y = start[q, 0] + enter * way[0], start[q, 1] + enter * way[1]
            i = min(max(math.floor(x), 0), size[0] - 1)
            j = min(max(math.floor(y), 0), size[1] - 1)
            step_x, step_y = (1 if way[0] > 0 else -1), (1 if way[1] > 0 else -1)
            gap_x = abs(1.0 / way[0]) if abs(way[0]) > 1e-12 else np.inf
            gap_y = abs(1.0 / way[1]) if abs(way[1]) > 1e-12 else np.inf
            next_x = enter + ((i + (step_x > 0)) - x) / way[0] if gap_x < np.inf else np.inf
            next_y = enter + ((j + (step_y > 0)) - y) / way[1] if gap_y < np.inf else np.inf
            at = enter
            while at < leave:
                if occupied[i, j]:
                    found[q, b] = at
                    break
                if next_x < next_y:
                    at, next_x, i = next_x, next_x + gap_x, i + step_x
                else:
                    at, next_y, j = next_y, next_y + gap_y, j + step_y
                if i < 0 or j < 0 or i >= size[0] or j >= size[1]:
                    break
