"""Causal tracking: from detected positions to pose and velocity of every pedestrian."""

from pedpred.tracking.kalman import Belief, born, predicted, updated
from pedpred.tracking.resampling import resampled
from pedpred.tracking.tracks import KalmanSettings, Tracks, follow, settled
from pedpred.tracking.tuning import log_likelihood, tune_kalman

__all__ = [
    "Belief",
    "KalmanSettings",
    "Tracks",
    "born",
    "follow",
    "log_likelihood",
    "predicted",
    "resampled",
    "settled",
    "tune_kalman",
    "updated",
]
