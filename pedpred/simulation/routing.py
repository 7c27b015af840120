"""Routes around obstacles: per target, the direction of least travel time (fast marching)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import skfmm
from scipy import ndimage

from pedpred.errors import ValueRuleError
from pedpred.simulation.ground import Ground, interpolate
from pedpred.simulation.settings import RoutingSettings

_SOURCE_RADIUS = 1.25  # of the disc around the target that the wave starts from, in routing cells
_POCKET_CELLS = 10  # enclosed ground of fewer routing cells is no place to go


class Routes(NamedTuple):
    """Desired walking directions to some targets, for bilinear interpolation.

    Attributes:
        target: end of the routes, world frame, m. [G, 2]
        origin: outer corner of routing cell (0, 0), world frame, m. [2]
        resolution_m: side of a routing cell, m.
        direction: unit vector at cell centres; 0 where the target cannot be reached. [G, X, Y, 2]
    """

    target: np.ndarray
    origin: np.ndarray
    resolution_m: float
    direction: np.ndarray


def routes_to(targets: np.ndarray, ground: Ground, settings: RoutingSettings) -> Routes:
    """Compute the direction fields to all targets.

    A target on blocked ground is moved to the nearest open routing cell.

    Args:
        targets: world frame, m. [G, 2]
        ground: obstacles.
        settings: resolution and clearance.
    """
    clearance = clearance_grid(ground, settings.resolution_m)
    blocked = without_pockets(clearance < settings.narrow_m)
    speed = walking_speed(clearance, settings)
    nearest = _nearest_open(blocked)
    targets = np.array(targets, dtype=np.float64).reshape(-1, 2)
    directions = np.zeros((len(targets), *blocked.shape, 2), dtype=np.float32)
    for index, target in enumerate(targets):
        cell = np.floor((target - ground.origin) / settings.resolution_m).astype(int)
        cell = np.clip(cell, 0, np.array(blocked.shape) - 1)
        if blocked[tuple(cell)]:
            cell = np.array([axis[tuple(cell)] for axis in nearest])
            targets[index] = ground.origin + (cell + 0.5) * settings.resolution_m
        time = travel_time(targets[index] - ground.origin, blocked, speed, settings.resolution_m)
        directions[index] = descent(time)[nearest[0], nearest[1]]
    return Routes(targets, ground.origin, float(settings.resolution_m), directions)


def without_pockets(blocked: np.ndarray) -> np.ndarray:
    """Block also the ground that is enclosed and too small for anybody to walk there. [X, Y] bool."""
    pocket, _ = ndimage.label(~blocked)
    return blocked | (np.bincount(pocket.ravel())[pocket] < _POCKET_CELLS)


def clearance_grid(ground: Ground, resolution_m: float) -> np.ndarray:
    """Distance to the obstacles at the centres of routing cells, m. [X, Y]."""
    size = np.ceil(np.array(ground.distance.shape) * ground.resolution_m / resolution_m - 1e-9).astype(int)
    centers = (np.moveaxis(np.indices(tuple(size.tolist())), 0, -1) + 0.5) * resolution_m
    return interpolate(ground.distance, centers / ground.resolution_m)


def walking_speed(clearance: np.ndarray, settings: RoutingSettings) -> np.ndarray:
    """Share of the full speed: 1 at comfortable clearance, falling to `slowest` at `narrow_m`. [X, Y]."""
    room = (clearance - settings.narrow_m) / (settings.comfortable_m - settings.narrow_m)
    return settings.slowest + (1.0 - settings.slowest) * np.clip(room, 0.0, 1.0)


def travel_time(
    target: np.ndarray, blocked: np.ndarray, speed: np.ndarray, resolution_m: float
) -> np.ndarray:
    """Eikonal equation |grad T| speed = 1 with T = 0 around the target; inf where it cannot be reached.

    Args:
        target: relative to the grid's corner, m. [2]
        blocked: impassable cells. [X, Y]
        speed: share of the full speed. [X, Y]
        resolution_m: side of a cell, m.

    Returns:
        Time at 1 m/s, s. Negative inside the disc that the wave starts from. [X, Y]
    """
    centers = (np.moveaxis(np.indices(blocked.shape), 0, -1) + 0.5) * resolution_m
    apart = np.linalg.norm(centers - target, axis=-1) - _SOURCE_RADIUS * resolution_m
    time = skfmm.travel_time(np.ma.array(apart, mask=blocked), speed, dx=resolution_m, order=1)
    return np.where(apart < 0, apart, np.ma.filled(time, np.inf))


def descent(time: np.ndarray) -> np.ndarray:
    """Unit vectors along -grad T; one-sided beside blocked cells, 0 where T is flat or inf. [X, Y, 2]."""
    slopes = []
    for axis in range(2):
        ends = [(1, 1) if a == axis else (0, 0) for a in range(2)]
        padded = np.pad(time, ends, constant_values=np.inf)
        with np.errstate(invalid="ignore"):
            steps = np.diff(padded, axis=axis)
        behind, ahead = (np.take(steps, np.arange(n, n + time.shape[axis]), axis) for n in (0, 1))
        known = np.isfinite(behind).astype(int) + np.isfinite(ahead)
        both = np.where(np.isfinite(behind), behind, 0.0) + np.where(np.isfinite(ahead), ahead, 0.0)
        slopes.append(both / np.maximum(known, 1))
    gradient = np.stack(slopes, axis=-1)
    length = np.linalg.norm(gradient, axis=-1, keepdims=True)
    return -gradient / np.where(length > 0, length, 1.0)


def _nearest_open(blocked: np.ndarray) -> np.ndarray:
    """For each cell the indices of the nearest cell that is not blocked. [2, X, Y]."""
    if blocked.all():
        raise ValueRuleError("occupancy", "every cell", "some ground must be free")
    return ndimage.distance_transform_edt(blocked, return_distances=False, return_indices=True)
