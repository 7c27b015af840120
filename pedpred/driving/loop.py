"""The closed loop: sensor, forecaster, planner, robot, at the robot's rate."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from pedpred.driving.crowds import MovingCrowd
from pedpred.driving.episodes import DriveSettings, Episode
from pedpred.driving.forecasters import Forecaster
from pedpred.driving.planner import Planner
from pedpred.driving.robot import advance
from pedpred.driving.sensor import visible
from pedpred.scenes import Forecast, OccupancyMap

ROBOT = -1
"""Track id of a robot that is shown to the forecaster."""


@dataclass(frozen=True)
class Drive:
    """What happened in an episode, from the first command on.

    Attributes:
        state: of the robot at each instant, see `Robot`. [T, 5]
        people: at the same instants, world frame, m; NaN: not there. [T, N, 2]
        there_s: for how long each person has been there, s. [T, N]
        dt_s: time between two instants, s.
        reached: whether the robot came to the goal.
        cycle_s: computing time of each cycle: forecast and plan, s. [T - 1]
        forecasts: of all frames, those while it watched included; only if asked for.
    """

    state: np.ndarray
    people: np.ndarray
    there_s: np.ndarray
    dt_s: float
    reached: bool
    cycle_s: np.ndarray
    forecasts: tuple[Forecast, ...] = ()


def drive(
    episode: Episode,
    crowd: MovingCrowd,
    forecaster: Forecaster,
    occupancy: OccupancyMap,
    settings: DriveSettings,
    keep: bool = False,
) -> Drive:
    """Drive to the goal of an episode, or until its time is over.

    Args:
        episode: what is to be done.
        crowd: its people, at the first instant.
        forecaster: that has seen nobody yet; it gets detections only.
        occupancy: the walls, which hide people.
        settings: of robot, planner and sensor.
        keep: whether to keep the forecasts.
    """
    robot, sensor, limits = settings.robot, settings.sensor, settings.robot.limits
    dt_s, goal = settings.planner.dt_s, episode.course.goal
    planner = Planner(robot, episode.course, settings.planner)
    state = (float(episode.start[0]), float(episode.start[1]), episode.heading_rad, 0.0, 0.0)
    states, cycles, forecasts, reached = [state], [], [], False
    people, there_s = [], []
    for tick in range(episode.ticks):
        crowd.meet(state, _velocity(state, settings))
        here = crowd.position
        seen = visible(state, here, occupancy, sensor) & (episode.faults.missed[tick] >= sensor.missed)
        detected = here[seen] + sensor.noise_m * episode.faults.noise[tick, seen]
        begun_s = time.perf_counter()
        forecast = _forecast(forecaster, tick * dt_s, crowd.track_id[seen], detected, state, settings)
        if keep:
            forecasts.append(forecast)
        if tick < episode.watching:
            crowd.advance()
            continue
        people.append(here)
        there_s.append(crowd.there_s)
        a, b = planner.command(state, forecast, max(sensor.noise_m, 0.01))
        cycles.append(time.perf_counter() - begun_s)
        crowd.advance()
        state = advance(state, float(a), float(b), limits, dt_s)
        states.append(state)
        reached = bool(np.hypot(goal[0] - state[0], goal[1] - state[1]) < settings.planner.near_m)
        if reached:
            break
    people.append(crowd.position)
    there_s.append(crowd.there_s)
    return Drive(
        np.array(states), np.array(people), np.array(there_s), dt_s, reached, np.array(cycles),
        tuple(forecasts),
    )  # fmt: skip


def _velocity(state: tuple[float, ...], settings: DriveSettings) -> np.ndarray:
    """Of the robot, world frame, m/s. [2]."""
    _, _, heading, a, b = state
    if settings.robot.limits.holonomic:
        return np.array([a, b])
    return a * np.array([np.cos(heading), np.sin(heading)])


def _forecast(
    forecaster: Forecaster,
    time_s: float,
    track_id: np.ndarray,
    position: np.ndarray,
    state: tuple[float, ...],
    settings: DriveSettings,
) -> Forecast:
    """Forecast the people; a robot that is shown is one of the detections, and none of the forecasts."""
    if not settings.shown:
        return forecaster.update(time_s, track_id, position)
    track_id, position = np.append(ROBOT, track_id), np.concatenate([[state[:2]], position])
    forecast = forecaster.update(time_s, track_id, position)
    people = forecast.track_id != ROBOT
    return replace(
        forecast,
        track_id=forecast.track_id[people],
        velocity=forecast.velocity[people],
        predictions=forecast.predictions.select(people),
    )
