"""Constant acceleration: the motion of the last three detections goes on."""

from __future__ import annotations

from pedpred.baselines.constant_velocity import straight_paths
from pedpred.forecasting import Forecaster, ForecastRequest
from pedpred.scenes import Predictions


def constant_acceleration() -> Forecaster:
    """Make the forecaster, p + v t + a t^2 / 2; it has no settings."""

    def forecast(request: ForecastRequest) -> Predictions:
        table, ahead_s = request.asked, request.ahead_s
        bend = 0.5 * table.last_acceleration[:, None] * (ahead_s**2)[:, None]
        return Predictions.single(straight_paths(table, ahead_s) + bend, request.sizes.dt_s)

    return forecast
