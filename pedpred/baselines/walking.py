"""Parameters of the filter of goals and desired speeds (`beliefs.py`), from those of the simulator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.simulation.forces import ForceSettings
from pedpred.simulation.settings import SocialForceSettings


@dataclass(frozen=True)
class Walking:
    """Parameters of the filter.

    Attributes:
        dt_s: T, time between two observations, s.
        keep: a, share of the velocity that is left after T.
        noise_mps: standard deviation of each component of the velocity after T.
        reach_m: a goal is reached at this distance.
        speed_mps: mean of desired speeds before any observation.
        speed_deviation_mps: their standard deviation.
        following: probability of each goal to follow another. [G, G]
        spread_m: a goal may lie this far from the place that stands for it; 0 = it is that place.
        forces: constants of the model.
    """

    dt_s: float
    keep: float
    noise_mps: float
    reach_m: float
    speed_mps: float
    speed_deviation_mps: float
    following: np.ndarray
    spread_m: float
    forces: ForceSettings


def walking(dt_s: float, model: SocialForceSettings, allowed: np.ndarray, spread_m: float) -> Walking:
    """Convert the simulator's constants to those of the filter.

    The acceleration noise is held for h and drawn anew, so the variance of the velocity after T is
    the sum over the draws, (sigma tau (1 - exp(-h / tau)))^2 sum_k exp(-2 k h / tau).

    Args:
        dt_s: time between two observations, s.
        model: of walking.
        allowed: which goals may follow which. [G, G] bool
        spread_m: see `Walking`.
    """
    tau, hold, step_s = model.forces.relaxation_time_s, model.clock.noise_hold_s, model.clock.step_s
    draws = np.arange(max(round(dt_s / hold), 1))
    one = model.clock.noise_mps2 * tau * (1.0 - np.exp(-hold / tau))
    return Walking(
        dt_s,
        (1.0 - step_s / tau) ** (dt_s / step_s),  # exp(-T / tau) as the simulator's Euler steps have it
        float(one * np.sqrt(np.exp(-2.0 * draws * hold / tau).sum())),
        model.crowd.reach_m,
        model.crowd.mean_speed_mps,
        model.crowd.speed_deviation_mps,
        allowed / allowed.sum(axis=1, keepdims=True),
        spread_m,
        model.forces,
    )
