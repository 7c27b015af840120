"""Occupancy crops and the angular pedestrian grid (Pfeiffer et al. 2018, III-B), compiled."""

from __future__ import annotations

import math

import numpy as np

from pedpred.compiled import compiled
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
    flat = occupancy.occupied.ravel()
    flat.flags.writeable = False  # of this view alone: whoever owns the map, one type is compiled
    _crop(flat, occupancy.occupied.shape, start, heading_rad, centers, resolution_m * scale, crops)
    return crops


@compiled
def _crop(flat, shape, start, heading_rad, centers, step, crops):  # pragma: no cover (compiled)
    """`start` and `step` are in map cells, `centers` in crop cells. Writes into `crops`.

    The loop over coordinates is vectorised; the look-ups in the map take most of the time.
    """
    size_x, size_y = shape
    cells = len(centers)
    for q in range(len(start)):
        cos, sin = math.cos(heading_rad[q]) * step, math.sin(heading_rad[q]) * step
        occupied = np.empty(cells * cells, np.uint8)
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
                occupied[i * cells + j] = index[j] >= 0 and flat[index[j]]
        words = occupied.view(np.uint64)
        for k in range(len(words)):  # number by number: assigning arrays takes seconds to compile
            crops[q, k] = np.uint8((words[k] * _GATHER_BITS) >> np.uint64(56))


def unpack_crops(crops: np.ndarray, cells: int) -> np.ndarray:
    """Expand bits to cells, [Q, cells^2 / 8] uint8 -> [Q, cells (forward), cells (left)] uint8, 0 or 1."""
    return np.unpackbits(crops, axis=-1, bitorder="little").reshape(-1, cells, cells)


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
    _scan(position, heading_rad, crowd, crowd_track, own_track, crowd_span, max_range_m, grids)
    return grids


@compiled
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


@compiled
def _scan(position, heading_rad, crowd, crowd_track, own_track, crowd_span, max_range_m, grids):
    """Find each neighbour's cone by a rough angle, or by atan2 where that lies near a cone's edge.

    In both cases the cone is floor((atan2(dy, dx) - heading) K / 2 pi) mod K. Writes into `grids`.
    """
    cells = grids.shape[1]
    cells_per_rad = cells / _TURN
    margin = _ANGLE_ERROR_RAD * cells_per_rad
    for q in range(len(position)):
        x, y, heading = position[q, 0], position[q, 1], heading_rad[q]
        turned = heading % _TURN
        first, count = crowd_span[q, 0], crowd_span[q, 1] - crowd_span[q, 0]
        square, cone = np.empty(count), np.empty(count)
        for c in range(count):
            dx, dy = crowd[first + c, 0] - x, crowd[first + c, 1] - y
            square[c] = dx * dx + dy * dy
            angle = _rough_angle(dx, dy) - turned  # [-pi, pi] - [0, 2 pi)
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
