"""Validation of the simulated walking: counts over all recorded states of a data set."""

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
"""Queueing: another person closer than this, within 90 degrees of the desired direction."""
PATIENCE = 3.0
"""A target should be reached within this multiple of the free-walking time."""
CLOSE_M = 0.3
_ROUNDING_MPS = 1e-6


@dataclass(frozen=True)
class WalkingCounts:
    """Counts over a scene; counts of several scenes add up.

    Attributes:
        states: recorded states of pedestrians.
        in_obstacle: states inside an obstacle.
        above_cap: states above the speed cap.
        slow: states below `SLOW_MPS`.
        slow_outside_queues: slow states without queueing, see `QUEUE_M`.
        close: states with another person nearer than `CLOSE_M`.
        targets: targets whose outcome is known: reached, or overdue by the end of the recording.
        reached: targets reached within `PATIENCE` times the free-walking time.
        speed_sum: sum of speed / desired speed.
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
        """The reported shares, with the counts they are based on."""
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
    """A simulated recording as arrays over time; all pedestrians are present at all instants."""

    position: np.ndarray  # [T, N, 2]
    velocity: np.ndarray  # [T, N, 2]
    goal: np.ndarray  # index into `goals` [T, N]
    goals: np.ndarray  # [G, 2]
    desired_speed: np.ndarray  # [N]


def count_walking(scenes: Iterable[Scene], settings: SocialForceSettings) -> WalkingCounts:
    """Count over simulated scenes.

    Raises:
        ValueRuleError: a scene lacks velocities, goals or desired speeds.
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
        raise ValueRuleError(
            "scene", scene.name, "only simulated scenes have goals, velocities and desired speeds"
        )
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
    """Whether each person has another nearer than `CLOSE_M`, and whether it queues. [T, N] bool each."""
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
    """Number of targets with a known outcome, and of those reached in time."""
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
        way_m = np.where(np.isfinite(way_m), way_m, straight_m)  # people pushed off the ground of the routes
        patience_s = PATIENCE * np.maximum(way_m, cell_m) / film.desired_speed[n]
        took_s = (ends - begins) * dt_s
        known = (ends < instants) | (took_s > patience_s)  # the others are still walking there
        targets += int(known.sum())
        reached += int((known & (took_s <= patience_s)).sum())
    return targets, reached
