"""Validation of the simulated walking: counts over recorded states, and two opposite streams in a corridor.

Density and speed in the corridor are measured with PedPy (Schroedter et al. 2024).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from typing import Annotated

import numpy as np
import pandas as pd
import pedpy

from pedpred.errors import ValueRuleError
from pedpred.scenes import Scene, Trajectories
from pedpred.settings import (
    LARGEST_SEED,
    In,
    Range,
    Settings,
    positive,
)
from pedpred.simulation.ground import ground_of
from pedpred.simulation.layouts import Layout, draw_targets
from pedpred.simulation.routing import clearance_grid, routes_to, travel_time
from pedpred.simulation.settings import SocialForceSettings
from pedpred.simulation.shapes import Rectangle
from pedpred.simulation.simulator import simulate

SLOW_MPS = 0.2
QUEUE_M = 1.0
"""Queueing: another person closer than this, within 90 degrees of the desired direction."""
PATIENCE = 3.0
"""A target should be reached within this multiple of the free-walking time."""
CLOSE_M = 0.3
_ROUNDING_MPS = 1e-6
_LARGEST_SIDE_M = 200.0
_CROWD = 40  # fewer people form lanes by chance, and make a poor picture


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
        of_states = ("in_obstacle", "above_cap", "slow", "slow_outside_queues", "close")
        return {
            "states": self.states,
            **{f"{name}_share": getattr(self, name) / self.states for name in of_states},
            "mean_speed_over_desired": self.speed_sum / self.states,
            "targets": self.targets,
            "targets_reached_share": self.reached / max(self.targets, 1),
        }


def count_walking(scenes: Iterable[Scene], settings: SocialForceSettings) -> WalkingCounts:
    """Count over simulated scenes.

    Raises:
        ValueRuleError: a scene lacks velocities, goals or desired speeds.
    """
    return sum((_counts(_film(scene), settings) for scene in scenes), WalkingCounts())


@dataclass(frozen=True)
class _Film:
    """A simulated recording as arrays over time; all pedestrians are present at all instants."""

    scene: Scene
    position: np.ndarray  # [T, N, 2]
    velocity: np.ndarray  # [T, N, 2]
    goal: np.ndarray  # index into `goals` [T, N]
    goals: np.ndarray  # [G, 2]
    desired_speed: np.ndarray  # [N]


def _film(scene: Scene) -> _Film:
    people = scene.trajectories
    if people.goal is None or people.velocity is None or people.desired_speed_mps is None:
        rule = "only simulated scenes have goals, velocities and desired speeds"
        raise ValueRuleError("scene", scene.name, rule)
    count = len(np.unique(people.track_id))
    goals, goal = np.unique(people.goal, axis=0, return_inverse=True)
    position, velocity = people.position.reshape(-1, count, 2), people.velocity.reshape(-1, count, 2)
    return _Film(scene, position, velocity, goal.reshape(-1, count), goals, people.desired_speed_mps[:count])


def _counts(film: _Film, settings: SocialForceSettings) -> WalkingCounts:
    speed = np.linalg.norm(film.velocity, axis=-1)
    slow = speed < SLOW_MPS
    close, queueing = _neighbours(film, settings)
    targets, reached = _targets(film, settings)
    return WalkingCounts(
        states=speed.size,
        in_obstacle=int(film.scene.occupancy.is_occupied(film.position).sum()),
        above_cap=int((speed > settings.forces.speed_cap * film.desired_speed + _ROUNDING_MPS).sum()),
        slow=int(slow.sum()),
        slow_outside_queues=int((slow & ~queueing).sum()),
        close=int(close.sum()),
        targets=targets,
        reached=reached,
        speed_sum=float((speed / film.desired_speed).sum()),
    )


def _neighbours(film: _Film, settings: SocialForceSettings) -> tuple[np.ndarray, np.ndarray]:
    """Whether each person has another nearer than `CLOSE_M`, and whether it queues. [T, N] bool each."""
    routes = routes_to(film.goals, ground_of(film.scene.occupancy), settings.routing)
    cell = ((film.position - routes.origin) / routes.resolution_m).astype(int)
    cell = cell.clip(0, np.array(routes.direction.shape[1:3]) - 1)
    way = routes.direction[film.goal, cell[..., 0], cell[..., 1]]
    to_others = film.position[:, None] - film.position[:, :, None]  # [T, N, N, 2]
    apart = np.linalg.norm(to_others, axis=-1)
    others = ~np.eye(apart.shape[1], dtype=bool)
    ahead = (to_others * way[:, :, None]).sum(axis=-1) > 0
    return ((apart < CLOSE_M) & others).any(axis=-1), ((apart < QUEUE_M) & ahead & others).any(axis=-1)


def _targets(film: _Film, settings: SocialForceSettings) -> tuple[int, int]:
    """Number of targets with a known outcome, and of those reached in time."""
    ground, cell_m = ground_of(film.scene.occupancy), settings.routing.resolution_m
    clearance = clearance_grid(ground, cell_m)
    blocked, plain = clearance < settings.routing.narrow_m, np.ones_like(clearance)
    free_m = np.array([travel_time(goal - ground.origin, blocked, plain, cell_m) for goal in film.goals])
    instants, people = film.goal.shape
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
        took_s = (ends - begins) * float(film.scene.detection_dt_s)
        known = (ends < instants) | (took_s > patience_s)  # the others are still walking there
        targets += int(known.sum())
        reached += int((known & (took_s <= patience_s)).sum())
    return targets, reached


@dataclass(frozen=True)
class FlowSettings(Settings):
    """Experiment in a corridor with a target region at each end.

    Attributes:
        size_m: length and width of the corridor. [2]
        end_m: depth of the target regions at its ends.
        measured_m: section of the corridor that is measured, from and to. [2]
        people: number of people of each run.
        settle_s: time before the measurement.
        seconds: measured time.
        lane_m: people with a smaller lateral distance walk in one lane.
        seed: of the experiment.
    """

    size_m: tuple[float, float]
    end_m: float
    measured_m: Range
    people: Annotated[tuple[int, ...], In("[1, 10000]")]
    settle_s: Annotated[float, In("[0, 36000]")]
    seconds: Annotated[float, In("(0, 36000]")]
    lane_m: Annotated[float, In("(0, 100]")]
    seed: Annotated[int, In(f"[0, {LARGEST_SEED}]")]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (positive("size_m", self.size_m, (2,)) <= _LARGEST_SIDE_M).all():
            raise ValueRuleError("size_m", self.size_m, f"a side may measure at most {_LARGEST_SIDE_M} m")
        In(f"(0, {self.size_m[0]}]").check("end_m", self.end_m, "a number")
        for end_m in self.measured_m:
            In(f"[0, {self.size_m[0]}]").check("measured_m", end_m, "two rising numbers")


def corridor_flow(settings: FlowSettings, model: SocialForceSettings) -> tuple[list[dict], Scene]:
    """Run the experiment for every number of people.

    Returns:
        A row per run (people, density, speed, lane order, lane order with shuffled directions), and the
        run of at least 40 people whose lane order exceeds the shuffled one most.
    """
    scenes = [_simulate_flow(people, settings, model) for people in settings.people]
    rows = []
    for people, scene in zip(settings.people, scenes, strict=True):
        walked = scene.trajectories
        measured = _density_and_speed(walked, people, settings) | _lane_orders(walked, people, settings)
        rows.append({"people": people, **measured})
    gain = [row["lane_order"] - row["lane_order_shuffled"] for row in rows]
    crowded = np.array(settings.people) >= _CROWD
    return rows, scenes[int(np.argmax(np.where(crowded, np.nan_to_num(gain, nan=-1.0), -2.0)))]


def _simulate_flow(people: int, settings: FlowSettings, model: SocialForceSettings) -> Scene:
    length, width = settings.size_m
    middles = (0.5 * settings.end_m, length - 0.5 * settings.end_m)
    layout = Layout(
        (length, width), (), [Rectangle((x, 0.5 * width), (settings.end_m, width)) for x in middles]
    )
    crowd = replace(model.crowd, spacing_m=0.35, target_spacing_m=0.5, clearance_m=0.3)  # so that all fit
    model = replace(model, crowd=crowd, clock=replace(model.clock, warm_up_s=settings.settle_s))
    rng = np.random.default_rng([settings.seed, people])
    occupancy = layout.occupancy()
    targets = draw_targets(layout, ground_of(occupancy), crowd, rng)
    return simulate("corridor_flow", occupancy, targets, model, people, settings.seconds, rng)


def _density_and_speed(walked: Trajectories, people: int, settings: FlowSettings) -> dict[str, float]:
    """Mean density, 1/m^2, and speed, m/s, in the measured section."""
    (low, high), width = settings.measured_m, settings.size_m[1]
    frame, (x, y) = np.repeat(np.arange(len(walked) // people), people), walked.position.T
    table = pd.DataFrame({"id": walked.track_id, "frame": frame, "x": x, "y": y})
    rate = 1.0 / float(walked.time_s[people] - walked.time_s[0])
    data = pedpy.TrajectoryData(data=table, frame_rate=rate)
    area = pedpy.MeasurementArea([(low, 0.0), (high, 0.0), (high, width), (low, width)])
    density = pedpy.compute_classic_density(traj_data=data, measurement_area=area)["density"]
    speeds = pedpy.compute_individual_speed(
        traj_data=data, frame_step=1, speed_calculation=pedpy.SpeedCalculation.BORDER_SINGLE_SIDED
    )
    inside = table.merge(speeds).query("@low <= x <= @high")
    return {"density_per_m2": float(density.mean()), "speed_mps": float(inside["speed"].mean())}


def _lane_orders(walked: Trajectories, people: int, settings: FlowSettings) -> dict[str, float]:
    """Lane order in the measured section, averaged over time, and its value for shuffled directions."""
    assert walked.velocity is not None
    rng = np.random.default_rng([settings.seed, people, 1])
    orders: tuple[list[float], list[float]] = ([], [])
    low, high = settings.measured_m
    for start in range(0, len(walked), people):
        rows = slice(start, start + people)
        x, y = walked.position[rows].T
        inside = (low <= x) & (x <= high)
        forward = walked.velocity[rows][inside, 0] > 0
        for scores, who in zip(orders, (forward, rng.permutation(forward)), strict=True):
            scores.append(lane_order(y[inside], who, settings.lane_m))
    real, chance = (float(np.nanmean(o)) if not np.isnan(o).all() else float("nan") for o in orders)
    return {"lane_order": real, "lane_order_shuffled": chance}


def lane_order(lateral_m: np.ndarray, forward: np.ndarray, lane_m: float) -> float:
    """Mean of phi_n = ((N_same - N_opposite) / (N_same + N_opposite))^2. Rex & Loewen 2007.

    N counts the others with a lateral distance below `lane_m` from n, anywhere along the corridor; 1 means
    perfect lanes.

    Args:
        lateral_m: position across the corridor. [N]
        forward: direction of each person. [N] bool
        lane_m: half the width of a lane.

    Returns:
        The order; NaN if all lanes hold one person.
    """
    same_lane = np.abs(lateral_m[:, None] - lateral_m) < lane_m
    np.fill_diagonal(same_lane, False)
    count = same_lane.sum(axis=1)
    balance = (same_lane * np.where(forward[:, None] == forward, 1, -1)).sum(axis=1)
    if not count.any():
        return float("nan")
    return float(np.mean((balance[count > 0] / count[count > 0]) ** 2))
