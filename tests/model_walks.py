"""Walks that a Kalman filter assumes."""

import numpy as np

from pedpred.scenes import Trajectories


def model_walks(rng, q, r, dt_s):
    """Walks with white-noise acceleration of density q, seen after each `dt_s` [N, T] with deviation r."""
    tracks, detections = dt_s.shape
    velocity, position = rng.normal(0, 1, (tracks, 2)), rng.normal(0, 5, (tracks, 2))
    seen = []
    for k in range(detections):
        h = dt_s[:, k : k + 1]
        a, b = rng.normal(size=(2, tracks, 2))  # a path and a velocity with the covariance Q
        position = position + h * velocity + np.sqrt(q * h**3) * (a / 2 + b / np.sqrt(12))
        velocity = velocity + np.sqrt(q * h) * a
        seen.append(position + rng.normal(0, r, position.shape))
    track_id = np.repeat(np.arange(tracks), detections)
    return Trajectories(np.cumsum(dt_s, axis=1).ravel(), track_id, np.stack(seen, axis=1).reshape(-1, 2))
