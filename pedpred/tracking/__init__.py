"""Causal tracking: positions in, pose and velocity of every pedestrian out."""

from pedpred.tracking.kalman import Belief, born, updated
from pedpred.tracking.tracks import KalmanSettings, Tracks, follow

__all__ = ["Belief", "KalmanSettings", "Tracks", "born", "follow", "updated"]
