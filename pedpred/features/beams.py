"""Distances to the nearest obstacle along beams around a pedestrian."""

from __future__ import annotations

import math

import numpy as np

from pedpred.compiled import compiled
from pedpred.scenes import OccupancyMap

_ALONG = 1e-12
"""Beams whose direction has a smaller component run along the other axis."""


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
    turns = 2.0 * math.pi * np.arange(beams) / beams
    shape, cells = occupancy.occupied.shape, occupancy.occupied.ravel()
    heading_rad = np.asarray(heading_rad, np.float64)
    _cast(cells, shape, start, heading_rad, turns, range_m / occupancy.resolution_m, found)
    found *= np.float32(occupancy.resolution_m)
    return np.minimum(found, np.float32(range_m))


@compiled
def _cast(cells, shape, start, heading_rad, turns, reach, found):  # pragma: no cover (compiled)
    """From cell edge to cell edge (Amanatides & Woo 1987); lengths are in cells. Writes into `found`."""
    for q in range(len(start)):
        for b in range(len(turns)):
            angle = heading_rad[q] + turns[b]
            way_x, way_y = math.cos(angle), math.sin(angle)
            from_x, to_x = _above(start[q, 0], way_x, shape[0], reach)
            from_y, to_y = _above(start[q, 1], way_y, shape[1], reach)
            enter, leave = max(from_x, from_y), min(to_x, to_y)
            found[q, b] = reach
            if enter >= leave:
                continue
            x, y = start[q, 0] + enter * way_x, start[q, 1] + enter * way_y
            i = min(max(math.floor(x), 0), shape[0] - 1)
            j = min(max(math.floor(y), 0), shape[1] - 1)
            next_x, gap_x = _edges(x, i, way_x, enter)
            next_y, gap_y = _edges(y, j, way_y, enter)
            step_x, left_x = (shape[1], shape[0] - i) if way_x > 0 else (-shape[1], i + 1)
            step_y, left_y = (1, shape[1] - j) if way_y > 0 else (-1, j + 1)
            cell, at = i * shape[1] + j, enter
            while at < leave:
                if cells[cell]:
                    found[q, b] = at
                    break
                if next_x < next_y:
                    at, next_x, cell, left_x = next_x, next_x + gap_x, cell + step_x, left_x - 1
                else:
                    at, next_y, cell, left_y = next_y, next_y + gap_y, cell + step_y, left_y - 1
                if left_x == 0 or left_y == 0:
                    break


@compiled
def _above(start, way, size, reach):  # pragma: no cover (compiled)
    """From where to where along a beam one coordinate is that of the map; lengths are in cells."""
    if abs(way) < _ALONG:
        return 0.0, reach if 0.0 <= start < size else -1.0
    one, other = -start / way, (size - start) / way
    return max(0.0, min(one, other)), min(reach, max(one, other))


@compiled
def _edges(x, i, way, enter):  # pragma: no cover (compiled)
    """Where a beam crosses the next edge between cells along one axis, and how far apart edges are."""
    if abs(way) <= _ALONG:
        return np.inf, np.inf
    return enter + ((i + (way > 0)) - x) / way, abs(1.0 / way)
