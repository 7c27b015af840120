"""Constant-velocity Kalman filter, batched over tracks, in closed form.

Both axes have the same noise and time stamps, so they share one 2 x 2 covariance of (position, velocity):
    x' = x + dt v,    Q = q [[dt^3/3, dt^2/2], [dt^2/2, dt]]   (white-noise acceleration)
Bar-Shalom, Li & Kirubarajan 2001, Estimation with Applications to Tracking and Navigation, 6.2.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pedpred.settings import In, Settings
from pedpred.tracking.spacing import SPACING_S


@dataclass(frozen=True)
class KalmanSettings(Settings):
    """Tracker parameters of one source.

    Attributes:
        acceleration_noise: spectral density q of the white-noise acceleration, m^2/s^3.
        position_noise_m: standard deviation r of a detection, m.
        initial_speed_mps: standard deviation of a velocity component at the start of a track, m/s.
    """

    acceleration_noise: Annotated[float, In("(0, 1e9]")]
    position_noise_m: Annotated[float, In("(0, 1e9]")]
    initial_speed_mps: Annotated[float, In("(0, 1e9]")] = 1.0


@dataclass(frozen=True)
class Belief:
    """Gaussian state estimates of N pedestrians at their last detection.

    Attributes:
        position: mean, world frame, m. [N, 2]
        velocity: mean, world frame, m/s. [N, 2]
        covariance: (P_pp [m^2], P_pv [m^2/s], P_vv [m^2/s^2]) of each axis. [N, 3]
    """

    position: np.ndarray
    velocity: np.ndarray
    covariance: np.ndarray


def initial_belief(position: np.ndarray, position_noise_m: float, initial_speed_mps: float) -> Belief:
    """Belief after the first detection: zero mean velocity with the prior standard deviation.

    Args:
        position: first detections, world frame, m. [N, 2]
        position_noise_m: standard deviation r of a detection, m.
        initial_speed_mps: prior standard deviation of a velocity component, m/s.
    """
    covariance = np.tile([position_noise_m**2, 0.0, initial_speed_mps**2], (len(position), 1))
    return Belief(position, np.zeros_like(position), covariance)


def predict(belief: Belief, dt_s: np.ndarray, acceleration_noise: float | np.ndarray) -> Belief:
    """Belief `dt_s` [N] later without further detections.

    Args:
        belief: after the last detections.
        dt_s: time since then, s. [N]
        acceleration_noise: spectral density q, m^2/s^3; of all or of each [N].
    """
    p_pp, p_pv, p_vv = belief.covariance.T
    q = acceleration_noise
    covariance = np.empty_like(belief.covariance)
    covariance[:, 0] = p_pp + 2 * dt_s * p_pv + dt_s**2 * p_vv + q * dt_s**3 / 3
    covariance[:, 1] = p_pv + dt_s * p_vv + q * dt_s**2 / 2
    covariance[:, 2] = p_vv + q * dt_s
    ahead = belief.position + dt_s[:, None] * belief.velocity
    return Belief(ahead, belief.velocity, covariance)


def correct(
    ahead: Belief, dt_s: np.ndarray, detection: np.ndarray, position_noise_m: float | np.ndarray
) -> Belief:
    """Belief after the next detections.

    The errors of a detector last longer than a few milliseconds, and bursts of frames must not count as many
    independent ones: a detection that follows the one before sooner than `SPACING_S` has the variance
    r^2 SPACING_S / dt.

    Args:
        ahead: from `predict`, at the detections.
        dt_s: time since the detections before, s. [N]
        detection: world frame, m. [N, 2]
        position_noise_m: standard deviation r of a detection, m; of all or of each [N].
    """
    p_pp, p_pv, p_vv = ahead.covariance.T
    innovation_variance = p_pp + position_noise_m**2 * np.maximum(1.0, SPACING_S / dt_s)
    gain_p, gain_v = p_pp / innovation_variance, p_pv / innovation_variance
    innovation = detection - ahead.position
    covariance = np.empty_like(ahead.covariance)
    covariance[:, 0], covariance[:, 1] = (1 - gain_p) * p_pp, (1 - gain_p) * p_pv
    covariance[:, 2] = p_vv - gain_v * p_pv
    position = ahead.position + gain_p[:, None] * innovation
    return Belief(position, ahead.velocity + gain_v[:, None] * innovation, covariance)
