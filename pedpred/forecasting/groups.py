"""Groups of people and modes by how far they go: what forecasts teach is learned of each by itself."""

from __future__ import annotations

import numpy as np

from pedpred.compiled import compiled
from pedpred.scenes import Predictions

GROUPS = 3
STILL, STIRRING, WALKING = range(GROUPS)
_LEAST_MPS = 0.05, 0.3
"""Least speeds of who stirs and of who walks, m/s."""


def groups_of(predictions: Predictions) -> np.ndarray:
    """Group of each person: STILL, STIRRING or WALKING, by the mean speed over the modes. [W] int64.

    Who stands still strays by millimetres, and things that a detector takes for people never move. Who stirs,
    at less than 0.3 m/s, may go anywhere.
    """
    return _groups(predictions)[:, -1]


def is_faster_mode(predictions: Predictions) -> np.ndarray:
    """Modes of a faster group than their person: to walk off, for somebody who stands. [W, K] bool."""
    groups = _groups(predictions)
    return groups[:, :-1] > groups[:, -1:]


def _groups(predictions: Predictions) -> np.ndarray:
    """Of each mode, and of the person. [W, K + 1]."""
    walked_s = (predictions.steps - 1) * predictions.dt_s
    groups = np.empty((len(predictions), predictions.modes + 1), np.int64)
    _write_groups(groups, predictions.path, predictions.weight, *(walked_s * least for least in _LEAST_MPS))
    return groups


@compiled
def _write_groups(
    groups: np.ndarray, path: np.ndarray, weight: np.ndarray, stirs_m: float, walks_m: float
) -> None:  # pragma: no cover (compiled)
    """By the way from the first step to the last, m."""
    for row in range(len(path)):
        mean = 0.0
        for k in range(weight.shape[1]):
            x, y = path[row, k, -1, 0] - path[row, k, 0, 0], path[row, k, -1, 1] - path[row, k, 0, 1]
            way = np.sqrt(x * x + y * y)
            groups[row, k] = int(way >= stirs_m) + int(way >= walks_m)
            mean += weight[row, k] * way
        groups[row, -1] = int(mean >= stirs_m) + int(mean >= walks_m)
