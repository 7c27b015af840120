"""The output tensors that networks have in common, offline and exported, and the predictions they mean.

Agent frame, W people, P steps, K modes; all but the velocities are optional:
    velocities  [W, P, 2]           of the point forecast, m/s
    path        [W, K, P, 2]        modes, m; without them the point forecast is the only one
    weight      [W, K]              probability of each mode
    covariance  [W, K, P, 2, 2]     of the positions within each mode, m^2
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pedpred.compiled import compiled
from pedpred.forecasting.reduction import merge_modes
from pedpred.scenes import Predictions

TENSORS = ("velocities", "path", "weight", "covariance")
_LEAST = 1e-5  # weight


def sound_rows(tensors: Mapping[str, np.ndarray]) -> np.ndarray:
    """For whom tensors are a forecast: finite, with weights, and with covariances that are some. [W] bool."""
    sound = np.ones(len(tensors["velocities"]), bool)
    if not len(sound):
        return sound
    for values in tensors.values():
        _keep_finite(values.reshape(len(sound), -1), sound)
    if "weight" in tensors:
        sound &= (tensors["weight"] >= 0).all(axis=1) & (tensors["weight"].sum(axis=1) > 0)
    if "covariance" in tensors:
        _keep_definite(tensors["covariance"].reshape(len(sound), -1, 4), sound)
    return sound


@compiled
def _keep_finite(values, sound):  # pragma: no cover (compiled)
    """Rows with a number that is not finite are not sound. [W, N], [W]."""
    for row in range(len(values)):
        for k in range(values.shape[1]):
            sound[row] &= np.isfinite(values[row, k])


@compiled
def _keep_definite(covariance, sound):  # pragma: no cover (compiled)
    """Rows with a covariance that is not positive definite are not sound. [W, N, 4], [W]."""
    for row in range(len(covariance)):
        for k in range(covariance.shape[1]):
            xx, xy = np.float64(covariance[row, k, 0]), np.float64(covariance[row, k, 1])
            sound[row] &= xx > 0.0 and xx * covariance[row, k, 3] > xy * xy


def predictions_of(tensors: Mapping[str, np.ndarray], dt_s: float) -> Predictions:
    """Agent-frame predictions; modes are sorted by weight, which is made to sum to 1.

    Weights are rounded: mirror images of each other, such as the modes of a straight walker on free ground,
    are equally likely, and their order must not depend on the last digits of a float. Of many modes, those
    most alike are merged, see `pedpred.forecasting.reduction`.
    """
    exact = {name: values.astype(np.float64) for name, values in tensors.items()}
    point = np.cumsum(exact["velocities"] * dt_s, axis=1)
    covariance = exact.get("covariance")
    if "path" not in exact:
        of_mode = None if covariance is None else covariance[:, 0]
        return Predictions.single(point, dt_s, of_mode, "agent")
    weight = np.maximum(np.round(exact["weight"] / exact["weight"].sum(axis=1, keepdims=True), 4), _LEAST)
    order = np.argsort(-weight, axis=1, kind="stable")
    rows = np.arange(len(point))[:, None]
    weight = weight[rows, order]
    sorted_modes = Predictions(
        point,
        exact["path"][rows, order],
        weight / weight.sum(axis=1, keepdims=True),
        dt_s,
        None if covariance is None else covariance[rows, order],
        "agent",
    )
    return merge_modes(sorted_modes)
