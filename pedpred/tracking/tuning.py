"""The tracker's noise parameters of one place, by maximum likelihood."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from pedpred.scenes import Recording
from pedpred.tracking.tracks import KalmanSettings, follow

_START = KalmanSettings(acceleration_noise=0.1, position_noise_m=0.1, initial_speed_mps=1.0)


def log_likelihood(recording: Recording, settings: KalmanSettings) -> float:
    """Mean log density of a detection, given the same pedestrian's earlier ones.

    With innovation n = z - x and S = P_pp + r^2 before the detection, both axes alike:
        log p(z) = -log(2 pi S) - |n|^2 / (2 S).
    Bar-Shalom, Li & Kirubarajan 2001, section 5.4.2. First detections are not counted.
    """
    tracks = follow(recording, "kalman", settings, standstill_mps=0.0)
    rows = np.flatnonzero(tracks.age > 0)
    before = tracks.belief_at(rows - 1, tracks.time_s[rows], settings.acceleration_noise)
    variance = before.covariance[:, 0] + settings.position_noise_m**2
    miss = ((tracks.detection[rows] - before.position) ** 2).sum(axis=1)
    return float((-np.log(2 * np.pi * variance) - miss / (2 * variance)).mean())


def tuned(recording: Recording) -> KalmanSettings:
    """The most likely noise parameters of a recording.

    Args:
        recording: detections of the *training* place.
    """

    def settings(logarithms: np.ndarray) -> KalmanSettings:
        return KalmanSettings(*np.exp(logarithms).tolist())

    start = [_START.acceleration_noise, _START.position_noise_m, _START.initial_speed_mps]
    found = minimize(
        lambda x: -log_likelihood(recording, settings(x)),
        np.log(start),
        method="Nelder-Mead",
        options={"xatol": 1e-4, "fatol": 1e-8},
    )
    return settings(found.x)
