"""Joint futures: everybody of an instant is rolled out together, by the simulator's own kernel."""

from __future__ import annotations

import numpy as np

from pedpred.simulation.crowd import Crowd
from pedpred.simulation.ground import Ground
from pedpred.simulation.routing import Routes
from pedpred.simulation.settings import SocialForceSettings
from pedpred.simulation.simulator import rollout

SAME_TIME_S = 1e-6


def rolled_out(
    crowd: Crowd,
    time_s: np.ndarray,
    ground: Ground,
    routes: Routes,
    model: SocialForceSettings,
    horizon_steps: int,
    dt_s: float,
) -> np.ndarray:
    """Noise-free futures of people at several instants; those of one instant walk together.

    Args:
        crowd: everybody at every instant. [W]
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
    """Indices of the rows of each instant, in the order of time. [W] -> some [N]."""
    order = np.argsort(time_s, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(time_s[order]) > SAME_TIME_S) + 1)
    return parts if len(order) else []
