"""Joint rollouts: all people of an instant are rolled out together, by the simulator's own kernel."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pedpred.features.surroundings import present_rows
from pedpred.forecasting import ForecastRequest
from pedpred.geometry import rotate
from pedpred.scenes import Predictions
from pedpred.simulation.crowd import Crowd
from pedpred.simulation.ground import Ground
from pedpred.simulation.routing import Routes
from pedpred.simulation.settings import SocialForceSettings
from pedpred.simulation.simulator import rollout

SAME_TIME_S = 1e-6


class Present(NamedTuple):
    """All people at some instants, by track and instant. World frame.

    Attributes:
        track_id: [R]
        time_s: the instant, s. [R]
        position: tracked; extrapolated from the last detection if that is earlier, m. [R, 2]
        velocity: tracked, m/s. [R, 2]
    """

    track_id: np.ndarray
    time_s: np.ndarray
    position: np.ndarray
    velocity: np.ndarray


def forecast_jointly(request: ForecastRequest, roll_out: Callable[[Present], np.ndarray]) -> Predictions:
    """Roll out all people who are present at the asked instants, and answer the asked rows.

    Args:
        request: what is asked.
        roll_out: people [R] -> their paths, world frame, m. [R, P, 2]
    """
    people, answers = present_at(request)
    return Predictions.single(roll_out(people)[answers], request.sizes.dt_s)


def present_at(request: ForecastRequest) -> tuple[Present, np.ndarray]:
    """Collect the people whom a joint forecast moves, and find the asked rows among them.

    Present is, as for the network's inputs, whose last detection is at most `max_age_intervals` old.

    Returns:
        People [R], and the index of each asked row. [W]
    """
    table, max_age_s = request.table, request.detection_interval_s * request.sizes.max_age_intervals
    now_s, instant = np.unique(table.time_s[request.rows], return_inverse=True)
    row, at = present_rows(table.track_id, table.time_s, now_s, max_age_s)
    _, track = np.unique(table.track_id, return_inverse=True)
    key = track[row] * len(now_s) + at
    order = np.argsort(key)
    row, time_s = row[order], now_s[at[order]]
    velocity = rotate(table.velocity[row], table.heading_rad[row]).astype(np.float64)
    position = table.position[row] + (time_s - table.time_s[row])[:, None] * velocity
    answers = np.searchsorted(key[order], track[request.rows] * len(now_s) + instant)
    return Present(table.track_id[row], time_s, position, velocity), answers


def roll_out_all(
    crowd: Crowd,
    time_s: np.ndarray,
    ground: Ground,
    routes: Routes,
    model: SocialForceSettings,
    horizon_steps: int,
    dt_s: float,
) -> np.ndarray:
    """Roll out people at several instants without noise; those of one instant walk together.

    Args:
        crowd: all people at every instant. [W]
        time_s: the instant. [W]
        ground: obstacles.
        routes: ways to the targets of the plans.
        model: forces and integration step.
        horizon_steps: P.
        dt_s: time between two steps of the horizon, s.

    Returns:
        World positions at time_s + dt_s * (1 ... P), m. [W, P, 2]
    """
    paths = np.empty((len(time_s), horizon_steps, 2))
    for rows in instants(time_s):
        present = Crowd(*(values[rows] for values in crowd))
        paths[rows] = rollout(present, ground, routes, model, horizon_steps, dt_s)
    return paths


def instants(time_s: np.ndarray) -> list[np.ndarray]:
    """Group the rows by instant, in the order of time. [W] -> indices [N] of each instant."""
    order = np.argsort(time_s, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(time_s[order])) + 1)
    return parts if len(order) else []
