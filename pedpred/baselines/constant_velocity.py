"""Constant velocity: the motion between the last two detections goes on."""

from __future__ import annotations

import numpy as np

from pedpred.features import FeatureTable
from pedpred.forecasting import Forecaster, ForecastRequest
from pedpred.scenes import Predictions


def constant_velocity() -> Forecaster:
    """Make the forecaster; it has no settings."""

    def forecast(request: ForecastRequest) -> Predictions:
        return Predictions.single(straight_paths(request.asked, request.ahead_s), request.sizes.dt_s)

    return forecast


def straight_paths(table: FeatureTable, ahead_s: np.ndarray) -> np.ndarray:
    """Last detected position and the velocity of the last interval, p + v t. [M, P, 2] m, world."""
    return table.last_position[:, None] + table.last_velocity[:, None] * ahead_s[:, None]
