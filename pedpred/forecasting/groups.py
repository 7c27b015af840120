"""People who are forecast to stand and to walk: what is learned of forecasts is learned of each by itself."""

from __future__ import annotations

import numpy as np

from pedpred.scenes import Predictions

GROUPS = 2
_WALKING_MPS = 0.3
"""People who are forecast to go slower than this, m/s, stand."""


def groups_of(predictions: Predictions) -> np.ndarray:
    """0 for who is forecast to stand, 1 for who is forecast to walk, by the point forecast. [W] int64.

    Who stands strays less than who walks, and things that a detector takes for people never move.
    """
    way = predictions.point[:, -1] - predictions.point[:, 0]
    slow_m = _WALKING_MPS * (predictions.steps - 1) * predictions.dt_s
    return (np.hypot(way[:, 0], way[:, 1]) >= slow_m).astype(np.int64)
