"""The angular pedestrian grid, APG (Pfeiffer et al. 2018, eq. 3)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from pedpred.features.threads import threads_for

_TURN = 2.0 * np.pi
_ANGLE_ERROR_RAD = 2e-5
"""Twice the error bound of `_rough_angle`."""


def angular_grids(
    position: np.ndarray,
    heading_rad: np.ndarray,
    crowd: np.ndarray,
    crowd_track: np.ndarray,
    own_track: np.ndarray,
    crowd_span: np.ndarray,
    cells: int,
    max_range_m: float,
) -> np.ndarray:
    """Distance of the nearest pedestrian in each cone around each query pedestrian.

    Cell k covers the angles [k, k+1) * 2 pi / cells, counter-clockwise from the heading:
    r_k = min(r_max, min { rho_j : phi_j in cell k, j another track }). Another track at exactly the
    same point has no direction and counts as lying towards world x.

    Args:
        position: query pedestrians, world frame, m. [Q, 2]
        heading_rad: of the query pedestrians. [Q]
        crowd: all pedestrians, grouped by instant, world frame, m. [C, 2]
        crowd_track: track of each row of `crowd`. [C]
        own_track: the query's own track, which is left out. [Q]
        crowd_span: rows [first, last) of `crowd` at the query's instant. [Q, 2]
        cells: number of cones K.
        max_range_m: r_max; also the value of an empty cone, m.

    Returns:
        Distances, m. [Q, cells] float32
    """
    grids = np.empty((len(position), cells), dtype=np.float32)
    with threads_for(len(position)):
        _scan(position, heading_rad, crowd, crowd_track, own_track, crowd_span, max_range_m, grids)
    return grids


@njit(cache=True, inline="always")
def _rough_angle(dx, dy):
    """Direction of a vector, rad, in [-pi, pi]; without branches, so that the compiler vectorises it.

    The odd polynomial for arctan on [0, 1] has an error of at most 1e-5 (Hastings 1955; Abramowitz &
    Stegun 1964, section 4.4).
    """
    across, along = abs(dx), abs(dy)
    ratio = min(across, along) / (max(across, along) + 1e-300)
    square = ratio * ratio
    series = 0.1801410 + square * (-0.0851330 + square * 0.0208351)
    angle = ratio * (0.9998660 + square * (-0.3302995 + square * series))
    angle = 0.5 * np.pi - angle if along > across else angle
    angle = np.pi - angle if dx < 0.0 else angle
    return -angle if dy < 0.0 else angle


@njit(parallel=True, cache=True)
def _scan(position, heading_rad, crowd, crowd_track, own_track, crowd_span, max_range_m, grids):
    """Find each neighbour's cone by a rough angle, or by atan2 where that lies near a cone's edge.

    In both cases the cone is floor((atan2(dy, dx) - heading) K / 2 pi) mod K. Writes into `grids`.
    """
    cells = grids.shape[1]
    cells_per_rad = cells / _TURN
    margin = _ANGLE_ERROR_RAD * cells_per_rad
    for q in prange(len(position)):
        x, y, heading = position[q, 0], position[q, 1], heading_rad[q]
        turned = heading % _TURN
        first, count = crowd_span[q, 0], crowd_span[q, 1] - crowd_span[q, 0]
        square, cone = np.empty(count), np.empty(count)
        for c in range(count):
            dx, dy = crowd[first + c, 0] - x, crowd[first + c, 1] - y
            square[c] = dx * dx + dy * dy
            angle = _rough_angle(dx, dy) - turned
            angle = angle + _TURN if angle < 0.0 else angle
            angle = angle + _TURN if angle < 0.0 else angle
            cone[c] = angle * cells_per_rad
        nearest = np.full(cells, max_range_m * max_range_m)
        for c in range(count):
            if square[c] < max_range_m * max_range_m and crowd_track[first + c] != own_track[q]:
                k = int(cone[c])
                if not k + margin < cone[c] < k + 1 - margin:
                    angle = math.atan2(crowd[first + c, 1] - y, crowd[first + c, 0] - x)
                    k = math.floor((angle - heading) * cells_per_rad) % cells
                nearest[k] = min(nearest[k], square[c])
        for k in range(cells):
            grids[q, k] = math.sqrt(nearest[k])
