"""Signed distance to the obstacles and its gradient, per cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from pedpred.scenes import OccupancyMap

_NOTHING_NEAR_M = 1e3  # distance on a map without obstacles
_FREE_M = 3.0  # ground around the map where people may walk; no border is felt farther away


class Ground(NamedTuple):
    """Obstacles of a place, sampled at cell centres, for bilinear interpolation.

    Attributes:
        origin: outer corner of cell (0, 0), world frame, m. [2]
        resolution_m: side of a cell, m.
        occupied: blocked cells. [X, Y]
        distance: to the nearest obstacle, m; negative inside one. [X, Y]
        away: gradient of `distance`; a unit vector, shorter midway between two obstacles. [X, Y, 2]
    """

    origin: np.ndarray
    resolution_m: float
    occupied: np.ndarray
    distance: np.ndarray
    away: np.ndarray


def ground_of(occupancy: OccupancyMap, margin_cells: int = 0) -> Ground:
    """Compute the distances on a map, padded with free cells (ground outside a map is free)."""
    occupied = np.pad(occupancy.occupied, margin_cells)
    distance = signed_distance(occupied, occupancy.resolution_m)
    # adjacent in memory: a look-up in a large map touches fewer cache lines
    border = np.stack([distance, *np.gradient(distance, occupancy.resolution_m)], axis=-1)
    origin = occupancy.origin - margin_cells * occupancy.resolution_m
    return Ground(origin, float(occupancy.resolution_m), occupied, border[..., 0], border[..., 1:])


def ground_around(occupancy: OccupancyMap, points: np.ndarray, cell_m: float) -> Ground:
    """Compute the distances on a map with free ground around it that holds all points, in whole cells.

    Args:
        occupancy: the obstacles.
        points: world frame, m. [M, 2]
        cell_m: side of the cells of routes, a multiple of the map's.
    """
    beyond = np.maximum(occupancy.origin - points, points - occupancy.origin - occupancy.extent_m)
    cells = max(round(cell_m / occupancy.resolution_m), 1)
    margin_m = float(beyond.max(initial=0.0)) + _FREE_M
    return ground_of(occupancy, cells * int(np.ceil(margin_m / (cells * occupancy.resolution_m))))


def signed_distance(occupied: np.ndarray, resolution_m: float) -> np.ndarray:
    """Distance from cell centres to the obstacles' edge, m; negative inside. [X, Y].

    The edge is half a cell in front of an occupied cell's centre, so the value is exact for
    straight borders along the grid.
    """
    if not occupied.any():
        return np.full(occupied.shape, _NOTHING_NEAR_M)
    outside = ndimage.distance_transform_edt(~occupied)
    inside = ndimage.distance_transform_edt(occupied)
    return np.where(occupied, 0.5 - inside, outside - 0.5) * resolution_m


def interpolate(values: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Interpolate bilinearly between cell centres, constant beyond the outermost ones.

    Args:
        values: one number per cell. [X, Y]
        cells: continuous cell coordinates, 0.5 is the centre of cell 0. [..., 2]

    Returns:
        Values at those points. [...]
    """
    return ndimage.map_coordinates(values, np.moveaxis(cells - 0.5, -1, 0), order=1, mode="nearest")
