"""Velocities that a source gives, beside the way that people went: do they lead from position to position?

A tracker that fills in zeros, or gives velocities relative to a robot, is believed like one that knows them,
and people are then forecast to walk backwards. Noise of positions does not add up, and steps far in the past
fade, so that one false jump is no contradiction.
"""

from __future__ import annotations

import numpy as np

_FADES_S = 3.0
"""Steps count for this time, s: somebody at 1.3 m/s who is said to stand is astray by up to 3.9 m."""
_ASTRAY_M = 2.0
"""Velocities that lead farther from the positions are not those of the person, m."""


def astray_after(
    before: np.ndarray, dt_s: np.ndarray, step: np.ndarray, was: np.ndarray, velocity: np.ndarray
) -> np.ndarray:
    """From where given velocities lead to where people are, m. [N, 2].

    Args:
        before: the same at the detections before, m. [N, 2]
        dt_s: time since then, s. [N]
        step: from those detections to the next ones, m. [N, 2]
        was: velocities there, m/s. [N, 2]
        velocity: given now, m/s. [N, 2]
    """
    time_s = dt_s[:, None]
    return np.exp(-time_s / _FADES_S) * before + step - 0.5 * time_s * (was + velocity)


def contradicted(astray: np.ndarray) -> np.ndarray:
    """Whose given velocities are not those of the person. [N, 2] -> [N] bool."""
    return np.hypot(*astray.T) > _ASTRAY_M
