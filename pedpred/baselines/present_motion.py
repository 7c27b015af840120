"""Forecasters that continue the present motion: they need neither settings nor a model of walking."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pedpred.features import FeatureTable
from pedpred.forecasting import Forecaster, ForecastRequest
from pedpred.geometry import rotate
from pedpred.scenes import Predictions
from pedpred.tracking import Belief, KalmanSettings, predict, steady_state


def constant_velocity() -> Forecaster:
    """Make the forecaster p + v t, with the motion between the last two detections."""

    def forecast(request: ForecastRequest) -> Predictions:
        return Predictions.single(straight_paths(request.asked, request.ahead_s), request.sizes.dt_s)

    return forecast


def constant_acceleration() -> Forecaster:
    """Make the forecaster p + v t + a t^2 / 2, with the motion of the last three detections."""

    def forecast(request: ForecastRequest) -> Predictions:
        table, ahead_s = request.asked, request.ahead_s
        bend = 0.5 * table.last_acceleration[:, None] * (ahead_s**2)[:, None]
        return Predictions.single(straight_paths(table, ahead_s) + bend, request.sizes.dt_s)

    return forecast


def kalman_velocity() -> Forecaster:
    """Make the forecaster p + v t of the tracked state, with the covariance that the tracker predicts.

    Without a tracker in the request it gives no covariance.
    """

    def forecast(request: ForecastRequest) -> Predictions:
        table, ahead_s = request.asked, request.ahead_s
        velocity = rotate(table.velocity, table.heading_rad)
        paths = table.position[:, None] + velocity[:, None] * ahead_s[:, None]
        covariance = None
        if request.tracker is not None:
            one_path = kalman_covariance(request.tracker, request.detection_interval_s, ahead_s)
            covariance = np.tile(one_path, (len(paths), 1, 1, 1))
        return Predictions.single(paths, request.sizes.dt_s, covariance)

    return forecast


def straight_paths(table: FeatureTable, ahead_s: np.ndarray) -> np.ndarray:
    """Last detected position and the velocity of the last interval, p + v t. [M, P, 2] m, world."""
    return table.last_position[:, None] + table.last_velocity[:, None] * ahead_s[:, None]


def kalman_covariance(tracker: KalmanSettings, interval_s: float, ahead_s: np.ndarray) -> np.ndarray:
    """Covariance of the next detections about the straight path of a tracked state.

    P_pp(t) + r^2 on either axis: the belief of a filter that has settled on regular detections, predicted
    over t, and the noise of the detection there. (A filter's covariance does not depend on what it
    sees, and settles within a few detections.)

    Args:
        tracker: noise parameters q and r that the tracks were filtered with.
        interval_s: time between two detections, s.
        ahead_s: times ahead, s. [P]

    Returns:
        World frame, m^2. [P, 2, 2]
    """
    now = steady_state(interval_s, tracker)
    each = Belief(*(np.repeat(part, len(ahead_s), axis=0) for part in vars(now).values()))
    after = predict(each, ahead_s, tracker.acceleration_noise)
    variance = after.covariance[:, 0] + tracker.position_noise_m**2
    return variance[:, None, None] * np.eye(2)


PRESENT_MOTION: dict[str, Callable[..., Forecaster]] = {
    "cv": constant_velocity,
    "ca": constant_acceleration,
    "kalman_cv": kalman_velocity,
}
"""Key -> factory; the strongest one is last. The light install is enough for these."""
STRONGEST = list(PRESENT_MOTION)[-1]
