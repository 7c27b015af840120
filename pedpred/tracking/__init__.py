"""Causal tracking: from detected positions to pose and velocity of every pedestrian."""

from pedpred.tracking.kalman import Belief, KalmanSettings, born, corrected, predicted
from pedpred.tracking.noise import KalmanBank
from pedpred.tracking.resampling import resampled
from pedpred.tracking.tracks import Tracks, follow, settled
from pedpred.tracking.tuning import log_likelihood, tune_kalman

__all__ = [
    "Belief",
    "KalmanBank",
    "KalmanSettings",
    "Tracks",
    "born",
    "corrected",
    "follow",
    "log_likelihood",
    "predicted",
    "resampled",
    "settled",
    "tune_kalman",
]
