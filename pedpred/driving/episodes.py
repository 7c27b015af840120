"""Episodes: when a robot starts, where, and where it goes, so that it meets people."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np
from scipy import ndimage

from pedpred.driving.course import (
    Course,
    Walls,
    connected_parts,
    course_to,
    part_at,
    route,
    walls_of,
)
from pedpred.driving.crowds import MovingCrowd, RecordedPeople, ReplayedCrowd
from pedpred.driving.planner import PlannerSettings, check_braking
from pedpred.driving.robot import Robot
from pedpred.driving.sensor import Faults, RobotSensor
from pedpred.errors import ValueRuleError
from pedpred.scenes import OccupancyMap, Scene
from pedpred.settings import In, Settings
from pedpred.simulation.physics import value_at

_TRIES = 20_000
_MOST_ROUTES = 1000  # are computed, which takes longer than all else
_CLEAR_M = 1.2  # nobody is nearer at the start
_MEET_M = 0.8  # somebody comes so near to a robot that would drive the route at full speed
_BESIDE_M = 1.0  # the robot stays so near to where people were recorded: farther off nobody is known
_AFTER_S = 3.0  # the true future is known so long after an episode
_WRONG_LENGTH = "of another length, or too late"
_NOBODY_NEAR = "nobody comes near"
_BLOCKED = "blocked by walls"


@dataclass(frozen=True)
class EpisodeSettings(Settings):
    """Which episodes are drawn.

    Attributes:
        distance_m: least and largest distance between start and goal.
        watching_s: the robot stands and watches for so long before it drives.
        patience_s: an episode ends so long after the time of an undisturbed drive.
    """

    distance_m: Annotated[tuple[float, float], In("[1, 1000]")] = (5.0, 10.0)
    watching_s: Annotated[float, In("[0, 60]")] = 2.0
    patience_s: Annotated[float, In("[0, 600]")] = 20.0


@dataclass(frozen=True)
class DriveSettings:
    """Everything that a drive depends on, besides its place, method and number.

    Attributes:
        robot: that drives.
        planner: with the limit of risk.
        sensor: on the robot.
        episodes: which are drawn.
        seed: of all random numbers.
        shown: whether the forecaster is told where the robot is, as one more person.

    Raises:
        ValueRuleError: the robot brakes for longer than a manoeuvre lasts.
    """

    robot: Robot = Robot()  # noqa: RUF009
    planner: PlannerSettings = PlannerSettings()  # noqa: RUF009
    sensor: RobotSensor = RobotSensor()  # noqa: RUF009
    episodes: EpisodeSettings = EpisodeSettings()
    seed: int = 0
    shown: bool = False

    def __post_init__(self) -> None:
        check_braking(self.robot, self.planner)


@dataclass(frozen=True)
class Place:
    """A recording, or a simulated world, in which robots drive.

    Attributes:
        name: of the scene.
        people: who walk there.
        occupancy: the walls.
        walls: distances to them, and to the border of the ground on which people were recorded.
    """

    name: str
    people: RecordedPeople
    occupancy: OccupancyMap
    walls: Walls

    @classmethod
    def of(cls, scene: Scene, dt_s: float) -> Place:
        """Prepare a scene for a robot's clock."""
        people = RecordedPeople(scene.trajectories, dt_s)
        return cls(scene.name, people, scene.occupancy, walls_of(_recorded_ground(scene)))


def _recorded_ground(scene: Scene) -> OccupancyMap:
    """The map, blocked where nobody was recorded: a robot must not wait beyond the view of the recording."""
    recorded = scene.occupancy
    margin = math.ceil(_BESIDE_M / recorded.resolution_m) + 1
    origin = recorded.origin - margin * recorded.resolution_m
    ground = OccupancyMap(np.pad(recorded.occupied, margin), origin, recorded.resolution_m)
    cells = ground.cell_of(scene.trajectories.position)
    cells = cells[((cells >= 0) & (cells < ground.occupied.shape)).all(axis=1)]
    visited = np.zeros(ground.occupied.shape, bool)
    visited[tuple(cells.T)] = True
    away_m = ndimage.distance_transform_edt(~visited) * recorded.resolution_m
    return replace(ground, occupied=ground.occupied | (away_m > _BESIDE_M))


@dataclass(frozen=True)
class Episode:
    """One drive that is to be done.

    Attributes:
        number: of the episode.
        tick: of the recording, at which the robot begins to watch.
        start: world frame, m. [2]
        heading_rad: along the route.
        course: to the goal.
        route_m: length of the route.
        watching: instants at which the robot stands and watches.
        people: at the first instant; recorded ones are known for some seconds more than the episode.
        faults: of the sensor.
        ticks: instants at most, those of watching included.
    """

    number: int
    tick: int
    start: np.ndarray
    heading_rad: float
    course: Course
    route_m: float
    watching: int
    people: MovingCrowd
    faults: Faults
    ticks: int

    def crowd(self) -> MovingCrowd:
        """The people of one drive, at its first instant."""
        return self.people.copied()


class NobodyMetError(ValueRuleError):
    """No episode is found where one is asked for.

    Attributes:
        refused: reason -> so many ways that were tried are not driven because of it.
    """

    def __init__(
        self, field: str, value: str, drives: DriveSettings, refused: Counter[str], where: str = ""
    ) -> None:
        (low_m, high_m), radius_m = drives.episodes.distance_m, drives.robot.radius_m
        reasons = ", ".join(f"{count} {why}" for why, count in refused.most_common())
        rule = f"{where}no way of {low_m:g} to {high_m:g} m of a robot of radius {radius_m:g} m meets anybody"
        super().__init__(field, value, f"{rule}. Of {refused.total()} tried: {reasons}")
        self.refused = refused


def draw_episode(
    place: Place, number: int, drives: DriveSettings, tries: int = _TRIES, last_s: float = np.inf
) -> Episode:
    """Draw an episode from (seed, number) alone: all methods get the same one.

    Start and goal are places where people were, the instant is one at which somebody was there. On an
    undisturbed way the robot would come within 0.8 m of somebody.

    Args:
        place: where.
        number: of the episode.
        drives: robot, planner, episodes and seed.
        tries: so many ways are tried.
        last_s: no episode begins later, s from the start of the recording.

    Raises:
        NobodyMetError: no such episode is found.
    """
    rng, refused = np.random.default_rng([drives.seed, number]), Counter[str]()
    parts = connected_parts(place.walls, drives.robot.radius_m)
    for _ in range(tries):
        if refused[_NOBODY_NEAR] == _MOST_ROUTES:
            break
        (tick, _), (_, start), (_, goal) = (place.people.draw_place(rng) for _ in range(3))
        if tick * drives.planner.dt_s > last_s:
            refused[_WRONG_LENGTH] += 1
            continue
        found = _route_or_reason(place, parts, tick, start, goal, drives)
        if isinstance(found, _Route):
            return _episode_along(found, place, number, tick, drives, rng)
        refused[found] += 1
    raise NobodyMetError("scene", place.name, drives, refused)


class _Route(NamedTuple):
    """A way to a goal: its points, m [R, 2], and their distance from the start along it, m [R]."""

    course: Course
    points: np.ndarray
    lengths: np.ndarray


def _route_or_reason(
    place: Place, parts: np.ndarray, tick: int, start: np.ndarray, goal: np.ndarray, drives: DriveSettings
) -> _Route | str:
    """The way from a start to a goal, or why no robot drives it; `parts`: of the ground."""
    robot, dt_s, watching = drives.robot, drives.planner.dt_s, _watching(drives)
    low_m, high_m = drives.episodes.distance_m
    if not low_m <= np.hypot(*(goal - start)) <= high_m:
        return _WRONG_LENGTH
    if not _has_room(place.walls, start, goal, robot):
        return "too near walls"
    one, other = (part_at(parts, place.walls, point) for point in (start, goal))
    if one != other or not one:
        return _BLOCKED
    if _nearest_m(place.people.window(tick, watching + 10).path[watching - 1 :], start) < _CLEAR_M:
        return "begin where somebody is"
    course = course_to(goal, place.walls, robot.radius_m)
    points = route(course, start, drives.planner.near_m)
    if not len(points):
        return _BLOCKED
    found = _Route(course, points, np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    people = place.people.window(tick + watching, _undisturbed(found, robot, dt_s) + 1)
    return found if _meets(people, found, robot.speed_mps) else _NOBODY_NEAR


def _episode_along(
    way: _Route, place: Place, number: int, tick: int, drives: DriveSettings, rng: np.random.Generator
) -> Episode:
    """The episode of a robot that drives along a way."""
    dt_s, watching, (course, points, lengths) = drives.planner.dt_s, _watching(drives), way
    towards = points[min(5, len(points) - 1)] - points[0]
    heading = float(np.arctan2(towards[1], towards[0]))
    ticks = watching + _undisturbed(way, drives.robot, dt_s) + round(drives.episodes.patience_s / dt_s)
    people = place.people.window(tick, ticks + 1 + round(_AFTER_S / dt_s))
    faults = Faults.draw(ticks, len(people.track_id), rng)
    length_m = float(lengths[-1])
    return Episode(number, tick, points[0], heading, course, length_m, watching, people, faults, ticks)


def _watching(drives: DriveSettings) -> int:
    """Instants at which the robot stands and watches."""
    return round(drives.episodes.watching_s / drives.planner.dt_s)


def _undisturbed(way: _Route, robot: Robot, dt_s: float) -> int:
    """Instants that a drive along a way takes at full speed."""
    return round(way.lengths[-1] / robot.speed_mps / dt_s)


def _has_room(walls: Walls, start: np.ndarray, goal: np.ndarray, robot: Robot) -> bool:
    clearance = (value_at(walls.distance, walls.origin, walls.cell_m, *point) for point in (start, goal))
    return min(clearance) > robot.radius_m + 0.15


def _nearest_m(position: np.ndarray, point: np.ndarray) -> float:
    """Least distance of anybody at any instant, m; infinite if nobody is there."""
    distance = np.hypot(*np.moveaxis(position - point, -1, 0))
    return float(np.nanmin(distance, initial=np.inf)) if np.isfinite(distance).any() else np.inf


def _meets(people: ReplayedCrowd, way: _Route, speed_mps: float) -> bool:
    """Whether somebody comes near a robot that drives a way at full speed."""
    travelled = np.arange(len(people.path)) * people.dt_s * speed_mps
    robot = np.stack([np.interp(travelled, way.lengths, axis) for axis in way.points.T], axis=-1)
    distance = np.hypot(*np.moveaxis(people.path - robot[:, None], -1, 0))
    return bool((distance < _MEET_M).any())
