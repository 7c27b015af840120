"""Simulation of a scene from a map and targets, and noise-free rollouts of a known crowd."""

from __future__ import annotations

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.simulation.crowd import Clock, Crowd, crowd_of
from pedpred.simulation.ground import Ground, ground_of
from pedpred.simulation.kernel import advance
from pedpred.simulation.layouts import TargetPool, open_cells, scattered
from pedpred.simulation.routing import Routes, routes_to
from pedpred.simulation.settings import CrowdSettings, SocialForceSettings

_NO_NOISE = np.empty((0, 0, 2))


def simulate(
    name: str,
    occupancy: OccupancyMap,
    targets: TargetPool,
    settings: SocialForceSettings,
    pedestrians: int,
    duration_s: float,
    rng: np.random.Generator,
) -> Scene:
    """Simulate people who walk between targets; record true states, goals and desired speeds.

    Noise: a Gaussian number of deviation `noise_mps2` is added to each component of the acceleration,
    held for `noise_hold_s` and then drawn again. For short holds this approaches white noise of
    density sigma^2 * hold, so the spread of a path does not depend on the integration step
    (Helbing & Molnar 1995, eq. 9, leave the time scale open).

    Args:
        name: of the scene.
        occupancy: closed map of the obstacles.
        targets: all goals are drawn from this pool.
        settings: model, routing, crowd and clock.
        pedestrians: number of people.
        duration_s: recorded time, after the warm-up.
        rng: source of all randomness.
    """
    ground = ground_of(occupancy)
    routes = routes_to(targets.position, ground, settings.routing)
    crowd = _drawn_crowd(ground, targets, settings, pedestrians, duration_s, rng)
    clock = settings.clock
    every, hold = round(clock.record_s / clock.step_s), round(clock.noise_hold_s / clock.step_s)
    skipped = round(clock.warm_up_s / clock.record_s)
    steps = (skipped + round(duration_s / clock.record_s)) * every
    noise = rng.normal(0.0, clock.noise_mps2, (-(-steps // hold), pedestrians, 2))
    ticks = Clock(clock.step_s, steps, every, hold)
    recorded = advance(crowd, noise, ticks, ground, routes, settings.forces, settings.crowd.reach_m)
    position, velocity, leg = (values[skipped:] for values in recorded)
    goal = routes.target[np.take_along_axis(crowd.plan, leg.T, axis=1).T]
    rows = leg.size
    trajectories = Trajectories(
        time_s=np.repeat(np.round(np.arange(len(leg)) * clock.record_s, 9), pedestrians),
        track_id=np.tile(np.arange(pedestrians), len(leg)),
        position=position.reshape(rows, 2),
        velocity=velocity.reshape(rows, 2),
        goal=goal.reshape(rows, 2),
        desired_speed_mps=np.tile(crowd.desired_speed, len(leg)),
    )
    return Scene(name, trajectories, occupancy, clock.record_s)


def rollout(
    crowd: Crowd,
    ground: Ground,
    routes: Routes,
    settings: SocialForceSettings,
    horizon_steps: int,
    dt_s: float,
) -> np.ndarray:
    """Simulate the noise-free future of a crowd; `crowd` itself is not changed.

    Args:
        crowd: states and plans.
        ground: obstacles.
        routes: to the targets of the plans.
        settings: model and integration step (shortened so that it divides `dt_s`).
        horizon_steps: number of positions P per pedestrian.
        dt_s: time between them, s.

    Returns:
        World positions, m. [N, P, 2]
    """
    every = int(np.ceil(dt_s / settings.clock.step_s - 1e-6))
    clock = Clock(dt_s / every, horizon_steps * every, every, 1)
    moving = crowd_of(crowd.position, crowd.velocity, crowd.desired_speed, crowd.plan, crowd.group)
    path, _, _ = advance(moving, _NO_NOISE, clock, ground, routes, settings.forces, settings.crowd.reach_m)
    return path.swapaxes(0, 1)


def draw_desired_speeds(count: int, settings: CrowdSettings, rng: np.random.Generator) -> np.ndarray:
    """Draw truncated normal desired speeds, m/s. [N]."""
    speeds = np.empty(0)
    least, most = settings.speed_range_mps
    while len(speeds) < count:
        drawn = rng.normal(settings.mean_speed_mps, settings.speed_deviation_mps, 2 * count)
        speeds = np.concatenate([speeds, drawn[(drawn >= least) & (drawn <= most)]])
    return speeds[:count]


def successors(position: np.ndarray, region: np.ndarray, least_leg_m: float) -> np.ndarray:
    """Which target may follow which: one of another region, far enough away (or the farthest).

    Args:
        position: of the targets, world frame, m. [G, 2]
        region: of the targets. [G]
        least_leg_m: least distance between successive targets.

    Returns:
        True where the column's target may follow the row's. [G, G] bool

    Raises:
        ValueRuleError: all targets lie in one region.
    """
    apart = np.linalg.norm(position[:, None] - position[None], axis=-1)
    other = region[:, None] != region[None]
    if not other.any(axis=1).all():
        raise ValueRuleError("targets", len(region), "they must lie in two regions at least")
    apart = np.where(other, apart, 0.0)
    return apart >= np.minimum(least_leg_m, apart.max(axis=1, keepdims=True))


def draw_visiting_plans(
    targets: TargetPool, count: int, legs: int, least_leg_m: float, rng: np.random.Generator
) -> np.ndarray:
    """Draw sequences of targets; successive ones differ in region and are far enough apart.

    Returns:
        Indices into the pool. [N, legs]

    Raises:
        ValueRuleError: all targets lie in one region.
    """
    allowed = successors(targets.position, targets.region, least_leg_m)
    choices = [np.flatnonzero(row) for row in allowed]
    plans = np.empty((count, legs), dtype=np.int64)
    plans[:, 0] = rng.integers(len(choices), size=count)
    draws = rng.random((count, legs))
    for leg in range(1, legs):
        for n in range(count):
            options = choices[plans[n, leg - 1]]
            plans[n, leg] = options[int(draws[n, leg] * len(options))]
    return plans


def _drawn_crowd(
    ground: Ground,
    targets: TargetPool,
    settings: SocialForceSettings,
    pedestrians: int,
    duration_s: float,
    rng: np.random.Generator,
) -> Crowd:
    """People at rest at random places, with plans longer than the simulated time."""
    crowd = settings.crowd
    cells = open_cells(ground, crowd.clearance_m)
    position = scattered(cells, pedestrians, crowd.spacing_m, rng)
    if len(position) < pedestrians:
        raise ValueRuleError("pedestrians", pedestrians, f"only {len(position)} fit on this map")
    speed = draw_desired_speeds(pedestrians, crowd, rng)
    farthest = (duration_s + settings.clock.warm_up_s) * settings.forces.speed_cap * speed.max()
    shortest_leg = max(crowd.least_leg_m - 2.0 * crowd.reach_m, crowd.reach_m)
    legs = int(np.ceil(farthest / shortest_leg)) + 2
    plan = draw_visiting_plans(targets, pedestrians, legs, crowd.least_leg_m, rng)
    return crowd_of(position, np.zeros((pedestrians, 2)), speed, plan)
