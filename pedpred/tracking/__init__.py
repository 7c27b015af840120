"""Causal tracking: positions in, pose and velocity of every pedestrian out."""

from pedpred.tracking.kalman import Belief, born, predicted, updated
from pedpred.tracking.resampling import resampled
from pedpred.tracking.tracks import KalmanSettings, Tracks, follow, settled
from pedpred.tracking.tuning import log_likelihood, tuned

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
    "tuned",
    "updated",
]
