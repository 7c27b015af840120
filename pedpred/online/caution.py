"""Caution about people who have just appeared: until they have clearly moved, they are forecast to stand.

Between two detections at 10 Hz, noise of a few cm looks like walking. A forecast is drawn towards the place
where the person is until the detections are farther apart than their noise explains, and becomes as much
wider as it is shortened, so that what was forecast before stays within one standard deviation.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pedpred.scenes import Predictions
from pedpred.tracking.tracks import TIME_TOLERANCE_S

NEWBORN, YOUNG_S = 3, 0.8
"""Who was detected at most so often, or first less than so long ago, s, counts as new."""
_NOISE, _MOTION = 2.5, 5.0
"""Displacements since the first detection that are noise or motion, in standard deviations of a detection."""


def have_just_appeared(age_s: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Who counts as new: by time since the first detection, s, and kept ones before the last. [N] bool."""
    return (age_s < YOUNG_S - TIME_TOLERANCE_S) | (kept < NEWBORN)


def moving_shares(
    first: np.ndarray, last: np.ndarray, new: np.ndarray, covariance: np.ndarray, noise_m: float
) -> np.ndarray:
    """Share of the motion to forecast: 0 where it may be noise, 1 for people who are not new. [N].

    Args:
        first: first detection, m. [N, 2]
        last: last detection, m. [N, 2]
        new: who has just appeared. [N] bool
        covariance: of the tracker's belief; 0 where velocities are known. [N, 3]
        noise_m: standard deviation of a detection, m.
    """
    away = np.linalg.norm(last - first, axis=-1) / noise_m
    share = np.clip((away - _NOISE) / (_MOTION - _NOISE), 0.0, 1.0)
    return np.where(new & covariance.any(axis=-1), share, 1.0)


def shorten_paths(predictions: Predictions, position: np.ndarray, share: np.ndarray) -> Predictions:
    """Shorten paths to a share [N] of their length from the people's positions, m [N, 2]."""
    if (share == 1.0).all():
        return predictions
    here, part = position[:, None, None], share[:, None, None, None]
    lost = (1.0 - part) * (predictions.path - here)
    covariance = predictions.covariance
    return replace(
        predictions,
        point=here[:, 0] + part[:, 0] * (predictions.point - here[:, 0]),
        path=predictions.path - lost,
        covariance=None if covariance is None else covariance + lost[..., None] * lost[..., None, :],
    )
