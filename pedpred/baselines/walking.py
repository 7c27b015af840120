"""Parameters of the filter of goals and desired speeds (`beliefs.py`), from those of the simulator."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pedpred.simulation.settings import SocialForceSettings


@dataclass(frozen=True)
class Walking:
    """Parameters of the filter.

    Attributes:
        dt_s: T, time between two observations, s.
        model: the simulator's constants.
        following: probability of each goal to follow another. [G, G]
        spread_m: a goal may lie this far from the place that stands for it; 0 = it is that place.
    """

    dt_s: float
    model: SocialForceSettings
    following: np.ndarray
    spread_m: float

    @cached_property
    def keep(self) -> float:
        """Share a of the velocity left after T: exp(-T / tau) as the simulator's Euler steps have it."""
        step_s = self.model.clock.step_s
        return (1.0 - step_s / self.model.forces.relaxation_time_s) ** (self.dt_s / step_s)

    @cached_property
    def noise_mps(self) -> float:
        """Standard deviation of each component of the velocity after T.

        The acceleration noise is held for h and drawn anew, so the variance is the sum over the draws,
        (sigma tau (1 - exp(-h / tau)))^2 sum_k exp(-2 k h / tau).
        """
        tau, hold = self.model.forces.relaxation_time_s, self.model.clock.noise_hold_s
        draws = np.arange(max(round(self.dt_s / hold), 1))
        one = self.model.clock.noise_mps2 * tau * (1.0 - np.exp(-hold / tau))
        return float(one * np.sqrt(np.exp(-2.0 * draws * hold / tau).sum()))
