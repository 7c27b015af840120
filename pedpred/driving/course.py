"""The way to a goal: distance to the walls and time to go, on a grid."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from pedpred.compiled import compiled
from pedpred.errors import ValueRuleError
from pedpred.scenes import OccupancyMap
from pedpred.simulation.ground import ground_of
from pedpred.simulation.physics import value_at
from pedpred.simulation.routing import clearance_grid, travel_time, walking_speed, without_pockets
from pedpred.simulation.settings import RoutingSettings

_CELL_M = 0.1
_MARGIN_M = 2.0  # free ground around a map
_ROUTE_STEP_M = 0.1
_MOST_CELLS = 20_000_000
_AROUND = np.indices((3, 3)).reshape(2, -1).T - 1


class Walls(NamedTuple):
    """Distance to the walls, for bilinear interpolation.

    Attributes:
        origin: outer corner of cell (0, 0), world frame, m. [2]
        cell_m: side of a cell, m.
        distance: to the nearest obstacle from the centres of cells, m. [X, Y]
    """

    origin: np.ndarray
    cell_m: float
    distance: np.ndarray


class Course(NamedTuple):
    """The way to one goal.

    Attributes:
        origin: outer corner of cell (0, 0), world frame, m. [2]
        cell_m: side of a cell, m.
        distance: to the nearest obstacle, m. [X, Y]
        to_go: length of the way to the goal, longer beside walls, m. [X, Y]
        goal: world frame, m. [2]
    """

    origin: np.ndarray
    cell_m: float
    distance: np.ndarray
    to_go: np.ndarray
    goal: np.ndarray


def walls_of(occupancy: OccupancyMap) -> Walls:
    """Measure distances on a map; the ground around it is free.

    Raises:
        ValueRuleError: the map is so large that ways on it would take more than a few GB.
    """
    width_m, height_m = occupancy.extent_m.tolist()
    if width_m * height_m > _MOST_CELLS * _CELL_M**2:
        most_m2 = _MOST_CELLS * _CELL_M**2
        rule = f"a robot drives on at most {most_m2:g} m2: leave out stray detections, or name a map"
        raise ValueRuleError("map", f"{width_m:.0f} x {height_m:.0f} m", rule)
    ground = ground_of(occupancy, math.ceil(_MARGIN_M / occupancy.resolution_m))
    return Walls(ground.origin, _CELL_M, clearance_grid(ground, _CELL_M))


def course_to(goal: np.ndarray, walls: Walls, radius_m: float) -> Course:
    """Find the ways to a goal from everywhere (fast marching).

    Ground too narrow for the robot has the length of the nearest wide place, and more, so that a robot that
    is there finds out. Where no way leads, the length is infinite: everywhere, if the goal is in a wall, in
    a narrow place or outside the ground.

    Args:
        goal: world frame, m. [2]
        walls: of the place.
        radius_m: of the robot.
    """
    routing = _routing(radius_m)
    parts = connected_parts(walls, radius_m)
    blocked = parts == 0
    pace = walking_speed(walls.distance, routing)
    if part_at(parts, walls, goal):
        to_go = travel_time(goal - walls.origin, blocked, pace, _CELL_M)
    else:
        to_go = np.full(parts.shape, np.inf)
    if blocked.any() and not blocked.all():
        away, nearest = ndimage.distance_transform_edt(blocked, return_indices=True)
        to_go = to_go[tuple(nearest)] + away * _CELL_M * 2.0
    return Course(walls.origin, walls.cell_m, walls.distance, to_go, np.asarray(goal, np.float64))


def connected_parts(walls: Walls, radius_m: float) -> np.ndarray:
    """Number the parts of the ground that no way connects, from 1; 0: too narrow for the robot. [X, Y]."""
    parts, _ = ndimage.label(~without_pockets(walls.distance < _routing(radius_m).narrow_m))
    return np.asarray(parts)


def part_at(parts: np.ndarray, walls: Walls, point: np.ndarray) -> int:
    """The part of the nearest open cell, within one cell of a point (world frame, m); 0 if there is none."""
    cells = np.floor((point - walls.origin) / walls.cell_m).astype(np.int64) + _AROUND
    cells = cells[((cells >= 0) & (cells < parts.shape)).all(axis=1)]
    apart_m = np.hypot(*(walls.origin + (cells + 0.5) * walls.cell_m - point).T)
    near = (parts[tuple(cells.T)] > 0) & (apart_m < walls.cell_m)
    return int(parts[tuple(cells[near][np.argmin(apart_m[near])])]) if near.any() else 0


def _routing(radius_m: float) -> RoutingSettings:
    return RoutingSettings(_CELL_M, radius_m + 0.1, radius_m + 0.5, 0.6)


@compiled
def ahead_at(course, x, y):  # pragma: no cover (compiled)
    """Direction in which the way to the goal becomes shorter, rad."""
    step = course.cell_m
    to_x = value_at(course.to_go, course.origin, step, x - step, y)
    to_x -= value_at(course.to_go, course.origin, step, x + step, y)
    to_y = value_at(course.to_go, course.origin, step, x, y - step)
    to_y -= value_at(course.to_go, course.origin, step, x, y + step)
    return math.atan2(to_y, to_x)


def route(course: Course, start: np.ndarray, near_m: float) -> np.ndarray:
    """Follow the shortest way, in steps of 0.1 m, until it is near the goal. World frame, m. [R, 2].

    Empty where no way leads from the start.
    """
    longest = value_at(course.to_go, course.origin, course.cell_m, *start)
    here = np.array(start, np.float64)
    points = [here]
    for _ in range(int(2 * longest / _ROUTE_STEP_M) if np.isfinite(longest) else 0):
        if np.hypot(*(course.goal - here)) < near_m:
            return np.array(points)
        angle = ahead_at(course, *here)
        here = here + _ROUTE_STEP_M * np.array([math.cos(angle), math.sin(angle)])
        points.append(here)
    return np.zeros((0, 2))
