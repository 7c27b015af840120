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

    Beam b points to 2 pi b / beams counter-clockwise from the heading. Ground outside the map is free. A beam
    that starts inside an obstacle leaves it first: where people are, there is none, and the map is shifted,
    coarse or out of date.

    Args:
        occupancy: static obstacles.
        position: world frame, m. [Q, 2]
        heading_rad: direction of the agent's x axis. [Q]
        beams: number of beams B.
        range_m: largest distance; also the value of a beam that meets nothing, m.

    Returns:
        Distances, m. [Q, B] float32
    """
    start = (np.asarray(position, np.float64) - occupancy.origin) / occupancy.resolution_m
    distance = np.empty((len(start), beams), np.float32)
    turns = 2.0 * math.pi * np.arange(beams) / beams
    shape, cells = occupancy.occupied.shape, occupancy.occupied.ravel()
    cells.flags.writeable = False  # of this view alone: whoever owns the map, one type is compiled
    heading_rad = np.asarray(heading_rad, np.float64)
    _cast(cells, shape, start, heading_rad, turns, range_m / occupancy.resolution_m, distance)
    distance *= np.float32(occupancy.resolution_m)
    return np.minimum(distance, np.float32(range_m))


@compiled
def _cast(cells, shape, start, heading_rad, turns, reach, distance):  # pragma: no cover (compiled)
    """Lengths are in cells. Writes into `distance`."""
    for q in range(len(start)):
        x, y = start[q, 0], start[q, 1]
        for b in range(len(turns)):
            angle = heading_rad[q] + turns[b]
            way_x, way_y = math.cos(angle), math.sin(angle)
            from_x, to_x = _span_on_map(x, way_x, shape[0], reach)
            from_y, to_y = _span_on_map(y, way_y, shape[1], reach)
            enter, leave = max(from_x, from_y), min(to_x, to_y)
            if enter >= leave:
                distance[q, b] = reach
            elif abs(way_x) >= abs(way_y):
                distance[q, b] = _first_wall(
                    cells, x, way_x, shape[0], shape[1], y, way_y, shape[1], 1, enter, leave, reach
                )
            else:
                distance[q, b] = _first_wall(
                    cells, y, way_y, shape[1], 1, x, way_x, shape[0], shape[1], enter, leave, reach
                )


@compiled
def _first_wall(
    cells, u, way_u, size_u, row_u, v, way_v, size_v, row_v, enter, leave, reach
):  # pragma: no cover (compiled)
    """How far it is to the first blocked cell behind a free one along a beam, or `reach`.

    From edge to edge along the axis u, along which the beam is faster: in between lie one cell or two. No
    step needs the result of the one before, so that the processor works on several steps at once. Lengths
    are in cells.

    Args:
        cells: of the map, row by row.
        u: start of the beam along this axis.
        way_u: component of its direction; |way_u| >= |way_v|.
        size_u: cells of the map along this axis.
        row_u: from a cell to the next one along this axis, in `cells`.
        v: start along the other axis.
        way_v: component of its direction.
        size_v: cells of the map along the other axis.
        row_v: from a cell to the next one along it.
        enter: where the beam enters the map.
        leave: where it leaves the map, or its end.
        reach: its end.
    """
    first = min(max(int(u + enter * way_u), 0), size_u - 1)
    last = min(max(int(u + leave * way_u), 0), size_u - 1)
    step, slope = (1 if way_u > 0 else -1), way_v / abs(way_u)
    edge = first + (way_u > 0)
    crossing = v + (edge - u) * (way_v / way_u)
    # crossing: v where the beam leaves the column of cells that begins at `row` of `cells`; here: the cell of
    # this column where the beam enters it; there: the one where it leaves it
    row = first * row_u
    here = row + min(max(int(v + enter * way_v), 0), size_v - 1) * row_v
    inside = enter == 0.0 and cells[here]
    for k in range(abs(last - first) + 1):
        beside = min(max(int(crossing), 0), size_v - 1)
        there = row + beside * row_v
        leaving = inside and cells[np.uint64(here)]
        inside = leaving and cells[np.uint64(there)]
        if (
            not leaving and cells[np.uint64(here)] | cells[np.uint64(there)]
        ):  # unsigned indices: no check for negative ones
            at = (edge + (k - 1) * step - u) / way_u if k else enter
            if not cells[here]:
                at = max(at, (beside + (way_v < 0) - v) / way_v)
            return at if at < leave else reach
        crossing += slope
        row += step * row_u
        here = there + step * row_u
    return reach


@compiled
def _span_on_map(start, way, size, reach):  # pragma: no cover (compiled)
    """Part [from, to] of a beam on which one of its coordinates is on the map; lengths are in cells."""
    if abs(way) < _ALONG:
        return 0.0, reach if 0.0 <= start < size else -1.0
    one, other = -start / way, (size - start) / way
    return max(0.0, min(one, other)), min(reach, max(one, other))
