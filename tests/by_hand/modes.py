"""Modes of two windows, and scenes to measure them in, for values by hand."""

import numpy as np

from pedpred.metrics import MetricScene
from pedpred.scenes import OccupancyMap, Predictions

FREE = OccupancyMap(np.zeros((3, 2), bool), np.array([-7.0, 4.0]), 0.5)


def scene_of(windows, occupancy=FREE, **given):
    usual = {"time_s": np.zeros(windows), "speed_mps": np.zeros(windows), "moving_mps": 0.5}
    return MetricScene(occupancy, **usual | {"collision_m": 0.25, "miss_m": 0.7} | given)


def modes_of(path, weight, covariance=None, point=None):
    """Predictions of modes [W, K, P, 2] with the same weights [K] in each window."""
    path = np.asarray(path, float)
    point = path[:, -1] + 20.0 if point is None else point
    return Predictions(point, path, np.tile(weight, (len(path), 1)), 0.3, covariance)


def covariances(*rows):
    """Sigma from (variance along x, covariance, variance along y). [..., 2, 2]."""
    xx, xy, yy = np.moveaxis(np.array(rows), -1, 0)
    return np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2)


PATHS = np.array([
    [[[0.3, 1.0], [1.0, 2.2], [1.5, 3.1]], [[-1.0, 0.4], [0.4, 0.9], [2.5, 0.0]], [[2, 2], [2, 4], [-3, 5]]],
    [[[0.1, 0.2], [0.9, 0.2], [1.0, 0.1]], [[0.4, 0.4], [3.4, 1.9], [2.5, -1.0]], [[5, 2], [2, 1], [-1, 1]]],
])  # fmt: skip
"""[2 windows, 3 modes, 3 steps, 2]"""
SHARES = np.array([0.55, 0.3, 0.15])
SIGMAS = np.tile(covariances(
    [[0.5, 0.1, 0.2], [0.9, -0.3, 0.4], [2.0, 0.7, 1.1]],
    [[0.3, 0.0, 0.6], [1.5, 0.5, 0.5], [1.0, -0.8, 2.0]],
    [[4.0, 1.0, 2.0], [0.2, 0.1, 0.3], [3.0, 0.2, 0.7]],
), (2, 1, 1, 1, 1))  # fmt: skip
SIGMAS[1] *= 1.7
SEEN = np.array([[[0.5, 0.8], [0.2, 1.4], [1.1, 1.9]], [[0.7, -0.2], [2.5, 1.1], [0.3, 0.4]]])
