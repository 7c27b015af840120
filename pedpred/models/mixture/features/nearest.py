"""The nearest pedestrians: where they are and how they move, as seen by each observer."""

from __future__ import annotations

import math

import numpy as np

from pedpred.compiled import compiled

NEIGHBOUR = 5
"""Numbers per neighbour: relative position (m) and velocity (m/s), (forward, left) each, and its weight.

The weight is 1, and falls to 0 over the last `FADE_M` of the range, so that nobody appears suddenly.
"""

FADE_M = 2.0
"""Width of the outer part of the range in which weights fall, m."""


def nearest_neighbours(
    position: np.ndarray,
    heading_rad: np.ndarray,
    crowd: np.ndarray,
    crowd_velocity: np.ndarray,
    crowd_track: np.ndarray,
    own_track: np.ndarray,
    crowd_span: np.ndarray,
    count: int,
    max_range_m: float,
) -> np.ndarray:
    """Collect the nearest pedestrians around each query pedestrian, the nearest first.

    Args:
        position: query pedestrians, world frame, m. [Q, 2]
        heading_rad: of the query pedestrians. [Q]
        crowd: all pedestrians, grouped by instant, world frame, m. [C, 2]
        crowd_velocity: world frame, m/s. [C, 2]
        crowd_track: track of each row of `crowd`; at equal distance the lower one comes first. [C]
        own_track: the query's own track, which is left out. [Q]
        crowd_span: rows [first, last) of `crowd` at the query's instant. [Q, 2]
        count: largest number of neighbours N.
        max_range_m: those farther away are left out, m.

    Returns:
        Agent frame; zeros behind the last neighbour. [Q, N, NEIGHBOUR] float32
    """
    neighbours = np.zeros((len(position), count, NEIGHBOUR), np.float32)
    _collect(
        position,
        heading_rad,
        crowd,
        crowd_velocity,
        crowd_track,
        own_track,
        crowd_span,
        max_range_m,
        neighbours,
    )
    return neighbours


@compiled
def _collect(
    position, heading_rad, crowd, crowd_velocity, crowd_track, own_track, crowd_span, range_m, neighbours
):  # pragma: no cover (compiled)
    """Insertion into a short sorted list per observer. Writes into `neighbours`."""
    count = neighbours.shape[1]
    for q in range(len(position)):
        square, who, taken = np.empty(count), np.empty(count, np.int64), 0
        for c in range(crowd_span[q, 0], crowd_span[q, 1]):
            dx, dy = crowd[c, 0] - position[q, 0], crowd[c, 1] - position[q, 1]
            square_m2 = dx * dx + dy * dy
            if crowd_track[c] == own_track[q] or square_m2 >= range_m * range_m:
                continue
            at = taken
            while at > 0 and (
                square[at - 1] > square_m2
                or (square[at - 1] == square_m2 and crowd_track[who[at - 1]] > crowd_track[c])
            ):
                at -= 1
            if at == count:
                continue
            for k in range(min(taken, count - 1), at, -1):
                square[k], who[k] = square[k - 1], who[k - 1]
            square[at], who[at] = square_m2, c
            taken = min(taken + 1, count)
        cos, sin = math.cos(heading_rad[q]), math.sin(heading_rad[q])
        for k in range(taken):
            dx, dy = crowd[who[k], 0] - position[q, 0], crowd[who[k], 1] - position[q, 1]
            vx, vy = crowd_velocity[who[k], 0], crowd_velocity[who[k], 1]
            neighbours[q, k, 0], neighbours[q, k, 1] = cos * dx + sin * dy, cos * dy - sin * dx
            neighbours[q, k, 2], neighbours[q, k, 3] = cos * vx + sin * vy, cos * vy - sin * vx
            neighbours[q, k, 4] = min((range_m - math.sqrt(square[k])) / FADE_M, 1.0)
