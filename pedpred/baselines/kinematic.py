"""Forecasts that only continue the present motion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pedpred.features import FeatureTable
from pedpred.geometry import rotate
from pedpred.tracking import Belief, KalmanSettings, predicted, settled


def constant_velocity(table: FeatureTable, ahead_s: np.ndarray) -> np.ndarray:
    """Last detected position and the velocity of the last interval, p + v t. [M, P, 2] m, world."""
    return table.last_position[:, None] + table.last_velocity[:, None] * ahead_s[:, None]


def constant_acceleration(table: FeatureTable, ahead_s: np.ndarray) -> np.ndarray:
    """Last three detections continued, p + v t + a t^2 / 2. [M, P, 2] m, world."""
    bend = 0.5 * table.last_acceleration[:, None] * (ahead_s**2)[:, None]
    return constant_velocity(table, ahead_s) + bend


def kalman_velocity(table: FeatureTable, ahead_s: np.ndarray) -> np.ndarray:
    """Tracked position and tracked velocity, p + v t. [M, P, 2] m, world."""
    velocity = rotate(table.velocity, table.heading_rad)
    return table.position[:, None] + velocity[:, None] * ahead_s[:, None]


def kalman_covariance(tracker: KalmanSettings, interval_s: float, ahead_s: np.ndarray) -> np.ndarray:
    """What the tracker itself says of where `kalman_velocity` sends a person's next detections.

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


KINEMATIC: dict[str, Callable[[FeatureTable, np.ndarray], np.ndarray]] = {
    "cv": constant_velocity,
    "ca": constant_acceleration,
    "kalman_cv": kalman_velocity,
}
"""(feature table, times ahead [P] s) -> paths [M, P, 2], world, m"""
