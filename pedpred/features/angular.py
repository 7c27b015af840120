"""The angular pedestrian grid, APG (Pfeiffer et al. 2018, eq. 3)."""

from __future__ import annotations

import numpy as np
from numba import njit, prange


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
    r_k = min(r_max, min { rho_j : phi_j in cell k, j is somebody else }).

    Args:
        position: query pedestrians, world frame, m. [Q, 2]
        heading_rad: of the query pedestrians. [Q]
        crowd: everybody, grouped by instant, world frame, m. [C, 2]
        crowd_track: whose position. [C]
        own_track: the query's own track, which does not see itself. [Q]
        crowd_span: rows [first, last) of `crowd` at the query's instant. [Q, 2]
        cells: number of cones K.
        max_range_m: r_max; also the value of an empty cone, m.

    Returns:
        Distances, m. [Q, cells] float32
    """
    grids = np.full((len(position), cells), max_range_m, dtype=np.float32)
    _scan(position, heading_rad, crowd, crowd_track, own_track, crowd_span, max_range_m, grids)
    return grids


@njit(parallel=True, cache=True)
def _scan(position, heading_rad, crowd, crowd_track, own_track, crowd_span, max_range_m, grids):
    cells = grids.shape[1]
    turn = 2.0 * np.pi
    for q in prange(len(position)):
        for c in range(crowd_span[q, 0], crowd_span[q, 1]):
            if crowd_track[c] == own_track[q]:
                continue
            dx, dy = crowd[c, 0] - position[q, 0], crowd[c, 1] - position[q, 1]
            distance = np.sqrt(dx * dx + dy * dy)
            if distance < max_range_m:
                angle = (np.arctan2(dy, dx) - heading_rad[q]) % turn
                cell = min(int(angle * cells / turn), cells - 1)
                grids[q, cell] = min(grids[q, cell], np.float32(distance))
