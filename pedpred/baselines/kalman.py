"""Constant velocity of the tracked state, with the covariance that the tracking filter predicts."""

from __future__ import annotations

import numpy as np

from pedpred.features import FeatureTable
from pedpred.forecasting import Forecaster, ForecastRequest
from pedpred.geometry import rotate
from pedpred.scenes import Predictions
from pedpred.tracking import Belief, KalmanSettings, predicted, settled


def kalman_velocity() -> Forecaster:
    """Make the forecaster; it has no settings. Without a tracker in the request it gives no covariance."""

    def forecast(request: ForecastRequest) -> Predictions:
        paths = tracked_paths(request.asked, request.ahead_s)
        covariance = None
        if request.tracker is not None:
            one_path = kalman_covariance(request.tracker, request.detection_interval_s, request.ahead_s)
            covariance = np.tile(one_path, (len(paths), 1, 1, 1))
        return Predictions.single(paths, request.sizes.dt_s, covariance)

    return forecast


def tracked_paths(table: FeatureTable, ahead_s: np.ndarray) -> np.ndarray:
    """Tracked position and tracked velocity, p + v t. [M, P, 2] m, world."""
    velocity = rotate(table.velocity, table.heading_rad)
    return table.position[:, None] + velocity[:, None] * ahead_s[:, None]


def kalman_covariance(tracker: KalmanSettings, interval_s: float, ahead_s: np.ndarray) -> np.ndarray:
    """Covariance of the next detections about `tracked_paths`, as the filter predicts it.

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
    now = settled(interval_s, tracker)
    each = Belief(*(np.repeat(part, len(ahead_s), axis=0) for part in vars(now).values()))
    after = predicted(each, ahead_s, tracker.acceleration_noise)
    variance = after.covariance[:, 0] + tracker.position_noise_m**2
    return variance[:, None, None] * np.eye(2)
