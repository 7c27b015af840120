"""Do simulated people walk as people do? What is checked over every recorded state of a data set."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import Scene
from pedpred.simulation.ground import ground_of
from pedpred.simulation.routing import clearance_grid, routes_to, travel_time
from pedpred.simulation.settings import SocialForceSettings

SLOW_MPS = 0.2
QUEUE_M = 1.0
"""Whoever has somebody this near, within 90 degrees of their way, stands in a queue."""
PATIENCE = 3.0
"""A target should be reached within this many times the time of free walking."""
CLOSE_M = 0.3
_ROUNDING_MPS = 1e-6


@dataclass(frozen=True)
class WalkingCounts:
    """Counts over a scene; those of several scenes add up.

    Attributes:
        states: recorded states of pedestrians.
        in_obstacle: of them inside an obstacle.
        above_cap: faster than the speed cap.
        slow: below `SLOW_MPS`.
        slow_outside_queues: of the slow ones those with nobody close ahead.
        close: with somebody nearer than `CLOSE_M`.
        targets: set within the recording, early enough to be reached with patience.
        reached: of them reached within `PATIENCE` times the free-walk time.
        speed_sum: of speed / desired speed.
    """

    states: int = 0
    in_obstacle: int = 0
    above_cap: int = 0
    slow: int = 0
    slow_outside_queues: int = 0
    close: int = 0
    targets: int = 0
    reached: int = 0
    speed_sum: float = 0.0

    def __add__(self, other: WalkingCounts) -> WalkingCounts:
        return WalkingCounts(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(self)))

    def shares(self) -> dict[str, float | int]:
        """What is reported; the counts beside the shares say how much they mean."""
        return {
            "states": self.states,
            "in_obstacle_share": self.in_obstacle / self.states,
            "above_cap_share": self.above_cap / self.states,
            "slow_share": self.slow / self.states,
            "slow_outside_queues_share": self.slow_outside_queues / self.states,
            "close_share": self.close / self.states,
            "mean_speed_over_desired": self.speed_sum / self.states,
            "targets": self.targets,
            "targets_reached_share": self.reached / max(self.targets, 1),
        }


@dataclass(frozen=True)
class _Film:
    """A simulated recording as arrays over time: every pedestrian is there at every instant."""

    position: np.ndarray  # [T, N, 2]
    velocity: np.ndarray  # [T, N, 2]
    goal: np.ndarray  # index into `goals` [T, N]
    goals: np.ndarray  # [G, 2]
    desired_speed: np.ndarray  # [N]


def count_walking(scenes: Iterable[Scene], settings: SocialForceSettings) -> WalkingCounts:
    """Count over simulated scenes.

    Raises:
        ValueRuleError: a scene does not know the velocities, goals and desired speeds of its people.
    """
    return sum((_one(scene, settings) for scene in scenes), WalkingCounts())


def _one(scene: Scene, settings: SocialForceSettings) -> WalkingCounts:
    film = _film(scene)
    speed = np.linalg.norm(film.velocity, axis=-1)
    slow = speed < SLOW_MPS
    near, ahead = _neighbours(scene, film, settings)
    targets, reached = _targets(scene, film, settings)
    return WalkingCounts(
        states=speed.size,
        in_obstacle=int(scene.occupancy.is_occupied(film.position).sum()),
        above_cap=int((speed > settings.forces.speed_cap * film.desired_speed + _ROUNDING_MPS).sum()),
        slow=int(slow.sum()),
        slow_outside_queues=int((slow & ~ahead).sum()),
        close=int(near.sum()),
        targets=targets,
        reached=reached,
        speed_sum=float((speed / film.desired_speed).sum()),
    )


def _film(scene: Scene) -> _Film:
    people = scene.trajectories
    if people.goal is None or people.velocity is None or people.desired_speed_mps is None:
        raise ValueRuleError("scene", scene.name, "only simulated scenes know what their people want")
    count = len(np.unique(people.track_id))
    goals, goal = np.unique(people.goal, axis=0, return_inverse=True)
    return _Film(
        people.position.reshape(-1, count, 2),
        people.velocity.reshape(-1, count, 2),
        goal.reshape(-1, count),
        goals,
        people.desired_speed_mps[:count],
    )


def _neighbours(scene: Scene, film: _Film, settings: SocialForceSettings) -> tuple[np.ndarray, np.ndarray]:
    """Who has somebody nearer than `CLOSE_M`, and who has somebody close ahead on their way. [T, N] each."""
    routes = routes_to(film.goals, ground_of(scene.occupancy), settings.routing)
    cell = ((film.position - routes.origin) / routes.resolution_m).astype(int)
    cell = cell.clip(0, np.array(routes.direction.shape[1:3]) - 1)
    way = routes.direction[film.goal, cell[..., 0], cell[..., 1]]
    to_others = film.position[:, None] - film.position[:, :, None]  # [T, N, N, 2]
    apart = np.linalg.norm(to_others, axis=-1)
    others = ~np.eye(apart.shape[1], dtype=bool)
    ahead = (to_others * way[:, :, None]).sum(axis=-1) > 0
    return ((apart < CLOSE_M) & others).any(axis=-1), ((apart < QUEUE_M) & ahead & others).any(axis=-1)


def _targets(scene: Scene, film: _Film, settings: SocialForceSettings) -> tuple[int, int]:
    """How many targets people set out for in time, and how many of them they reached in time."""
    ground = ground_of(scene.occupancy)
    cell_m = settings.routing.resolution_m
    clearance = clearance_grid(ground, cell_m)
    blocked, plain = clearance < settings.routing.narrow_m, np.ones_like(clearance)
    free_m = np.array([travel_time(goal - ground.origin, blocked, plain, cell_m) for goal in film.goals])
    instants, people = film.goal.shape
    dt_s = float(scene.detection_dt_s)
    targets = reached = 0
    for n in range(people):
        begins = np.flatnonzero(np.diff(film.goal[:, n])) + 1
        ends = np.append(begins, instants)[1:]
        cell = ((film.position[begins, n] - ground.origin) / cell_m).astype(int)
        cell = cell.clip(0, np.array(blocked.shape) - 1)
        goal = film.goal[begins, n]
        way_m = free_m[goal, cell[:, 0], cell[:, 1]]
        straight_m = np.linalg.norm(film.position[begins, n] - film.goals[goal], axis=-1)
        way_m = np.where(np.isfinite(way_m), way_m, straight_m)  # someone pushed off the routes' ground
        patience_s = PATIENCE * np.maximum(way_m, cell_m) / film.desired_speed[n]
        took_s = (ends - begins) * dt_s
        told = (ends < instants) | (took_s > patience_s)  # the others are still on their way
        targets += int(told.sum())
        reached += int((told & (took_s <= patience_s)).sum())
    return targets, reached
