"""Joint rollouts: all people of an instant are rolled out together, by the simulator's own kernel."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pedpred.features import FeatureTable
from pedpred.forecasting import ForecastRequest
from pedpred.scenes import Predictions
from pedpred.simulation.crowd import Crowd
from pedpred.simulation.ground import Ground
from pedpred.simulation.routing import Routes
from pedpred.simulation.settings import SocialForceSettings
from pedpred.simulation.simulator import rollout

SAME_TIME_S = 1e-6
_SAME_INSTANT_S = 1e-4


def forecast_jointly(request: ForecastRequest, roll_out: Callable[[np.ndarray], np.ndarray]) -> Predictions:
    """Roll out all people who are present at the asked instants, and answer the asked rows.

    Args:
        request: what is asked.
        roll_out: rows of the table [R] -> their paths, world frame, m. [R, P, 2]
    """
    everybody = seen_together(request.table, request.rows)
    paths = roll_out(everybody)
    return Predictions.single(paths[np.searchsorted(everybody, request.rows)], request.sizes.dt_s)


def seen_together(table: FeatureTable, asked: np.ndarray) -> np.ndarray:
    """Find the rows at the instants of some rows: all people whom a joint forecast moves. [R].

    At such an instant (an annotation) each track has a row in exactly one of its phases.

    Args:
        table: of a scene.
        asked: the rows, mask or indices.
    """
    instant = np.round(table.time_s / _SAME_INSTANT_S).astype(np.int64)
    return np.flatnonzero(np.isin(instant, instant[asked]))


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
    parts = np.split(order, np.flatnonzero(np.diff(time_s[order]) > SAME_TIME_S) + 1)
    return parts if len(order) else []
