"""The tracker's noise parameters of one place, by maximum likelihood."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from pedpred.scenes import Trajectories
from pedpred.tracking.tracks import KalmanSettings, follow

_START = KalmanSettings(acceleration_noise=0.1, position_noise_m=0.1, initial_speed_mps=1.0)


def log_likelihood(trajectories: Trajectories, settings: KalmanSettings, ahead: int) -> float:
    """Mean log density of the next `ahead` detections of a pedestrian, each given those up to now.

    With innovation n = z - x and S = P_pp + r^2 of the state extrapolated to that detection, both axes alike:
        log p(z) = -log(2 pi S) - |n|^2 / (2 S).
    One detection ahead, it is the filter's likelihood (Bar-Shalom, Li & Kirubarajan 2001, section
    5.4.2); farther, a composite likelihood (Varin, Reid & Firth 2011) of what the tracker is asked for.

    Args:
        trajectories: detections.
        settings: noise parameters.
        ahead: how many detections, counted within a life.
    """
    tracks = follow(trajectories, "kalman", settings, standstill_mps=0.0)
    total, count = 0.0, 0
    for distance in range(1, ahead + 1):
        row = np.arange(len(tracks.life) - distance)
        row = row[tracks.life[row] == tracks.life[row + distance]]
        after = tracks.belief_at(row, tracks.time_s[row + distance], settings.acceleration_noise)
        variance = after.covariance[:, 0] + settings.position_noise_m**2
        miss = ((tracks.detection[row + distance] - after.position) ** 2).sum(axis=1)
        total += float((-np.log(2 * np.pi * variance) - miss / (2 * variance)).sum())
        count += len(row)
    return total / count


def tuned(trajectories: Trajectories, ahead: int) -> KalmanSettings:
    """The most likely noise parameters of a recording.

    Args:
        trajectories: detections of the *training* place.
        ahead: see `log_likelihood`.
    """

    def settings(logarithms: np.ndarray) -> KalmanSettings:
        return KalmanSettings(*np.exp(logarithms).tolist())

    start = [_START.acceleration_noise, _START.position_noise_m, _START.initial_speed_mps]
    found = minimize(
        lambda x: -log_likelihood(trajectories, settings(x), ahead),
        np.log(start),
        method="Nelder-Mead",
        options={"xatol": 1e-4, "fatol": 1e-9},
    )
    return settings(found.x)
