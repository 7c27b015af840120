"""Maximum-likelihood noise parameters of the tracker for one place."""

from __future__ import annotations

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import Trajectories
from pedpred.tracking.kalman import KalmanSettings
from pedpred.tracking.tracks import follow

_START = KalmanSettings(acceleration_noise=0.1, position_noise_m=0.1, initial_speed_mps=1.0)

LEAST, MOST = 1e-4, 100.0
"""Range of the fitted parameters: the likelihood of detections without noise has no maximum."""
_DISTANCES = 12
"""Detections ahead are compared at no more distances than this, evenly spread."""


def log_likelihood(trajectories: Trajectories, settings: KalmanSettings, ahead: int) -> float:
    """Mean log density of the next `ahead` detections, each given the detections up to now.

    With innovation n = z - x and S = P_pp + r^2 of the state extrapolated to that detection, per axis:
        log p(z) = -log(2 pi S) - |n|^2 / (2 S).
    For one detection ahead this is the filter's likelihood (Bar-Shalom, Li & Kirubarajan 2001, section
    5.4.2); for more, a composite likelihood (Varin, Reid & Firth 2011) over the range of the forecasts.

    Args:
        trajectories: detections.
        settings: noise parameters.
        ahead: number of detections, counted within a life; of more than 12, twelve are taken, evenly spread.

    Raises:
        ValueRuleError: nobody is detected twice.
    """
    tracks = follow(trajectories, "kalman", settings, standstill_mps=0.0)
    total, count = 0.0, 0
    for distance in np.unique(np.linspace(1, ahead, min(ahead, _DISTANCES)).round().astype(int)):
        row = np.arange(len(tracks.life) - distance)
        row = row[tracks.life[row] == tracks.life[row + distance]]
        after = tracks.belief_at(row, tracks.time_s[row + distance], settings.acceleration_noise)
        variance = after.covariance[:, 0] + settings.position_noise_m**2
        miss = ((tracks.detection[row + distance] - after.position) ** 2).sum(axis=1)
        total += float((-np.log(2 * np.pi * variance) - miss / (2 * variance)).sum())
        count += len(row)
    if not count:
        raise ValueRuleError("detections", len(tracks.life), "nobody is detected twice")
    return total / count


def tune_kalman(trajectories: Trajectories, ahead: int, tolerance: float = 1e-4) -> KalmanSettings:
    """Fit the noise parameters, each from `LEAST` to `MOST`, to a recording by maximum likelihood.

    Args:
        trajectories: detections.
        ahead: see `log_likelihood`.
        tolerance: relative one of the parameters.

    Raises:
        ValueRuleError: nobody is detected twice.
    """
    from scipy.optimize import minimize  # late: a robot has no SciPy

    def settings(logarithms: np.ndarray) -> KalmanSettings:
        return KalmanSettings(*np.clip(np.exp(logarithms), LEAST, MOST).tolist())

    start = np.log([_START.acceleration_noise, _START.position_noise_m, _START.initial_speed_mps])
    simplex = np.vstack([start, start + np.eye(3)])  # a factor of e in each parameter
    options = {"xatol": tolerance, "fatol": 0.1 * tolerance**2, "initial_simplex": simplex}
    optimum = minimize(
        lambda x: -log_likelihood(trajectories, settings(x), ahead),
        start,
        method="Nelder-Mead",
        options=options,
    )
    return settings(optimum.x)
