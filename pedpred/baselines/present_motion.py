"""Baselines that continue the present motion: they need neither settings nor a model of walking."""

from __future__ import annotations

from collections.abc import Callable

from pedpred.baselines.constant_acceleration import constant_acceleration
from pedpred.baselines.constant_velocity import constant_velocity
from pedpred.baselines.kalman import kalman_velocity
from pedpred.forecasting import Forecaster

PRESENT_MOTION: dict[str, Callable[..., Forecaster]] = {
    "cv": constant_velocity,
    "ca": constant_acceleration,
    "kalman_cv": kalman_velocity,
}
"""Key -> factory; the strongest one is last. The light install is enough for these."""
STRONGEST = list(PRESENT_MOTION)[-1]
