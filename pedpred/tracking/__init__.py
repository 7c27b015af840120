"""Causal tracking: from detected positions to pose and velocity of every pedestrian."""

from pedpred.tracking.kalman import Belief, KalmanSettings, correct, initial_belief, predict
from pedpred.tracking.noise import KalmanBank
from pedpred.tracking.resampling import resampled
from pedpred.tracking.tracks import Tracks, follow, steady_state
from pedpred.tracking.tuning import log_likelihood, tune_kalman

__all__ = [
    "Belief",
    "KalmanBank",
    "KalmanSettings",
    "Tracks",
    "correct",
    "follow",
    "initial_belief",
    "log_likelihood",
    "predict",
    "resampled",
    "steady_state",
    "tune_kalman",
]
