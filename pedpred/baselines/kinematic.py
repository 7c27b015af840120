"""Forecasts that only continue the present motion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pedpred.features import FeatureTable
from pedpred.geometry import rotate


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


KINEMATIC: dict[str, Callable[[FeatureTable, np.ndarray], np.ndarray]] = {
    "cv": constant_velocity,
    "cacc": constant_acceleration,
    "kalman_cv": kalman_velocity,
}
"""(feature table, times ahead [P] s) -> paths [M, P, 2], world, m"""
