"""Steps from one detection of a person to the next one that nobody can have made."""

from __future__ import annotations

import numpy as np

_ERROR_M, _RUNNING_MPS = 0.5, 4.0
"""Nobody moves farther between two detections than at this speed, m/s, and by this error, m, as a rule."""
_LEAST_M, _CATCHING_UP_MPS = 0.1, 6.0
"""Who has stood at exactly one place does not start with a step that is longer and faster than these."""


def are_too_long(way_m: np.ndarray, gap_s: np.ndarray) -> np.ndarray:
    """Which steps are longer than people move: a few are false detections, many are false ids or units.

    Args:
        way_m: length of each step, m. [N]
        gap_s: time that it took, s. [N]

    Returns:
        [N] bool
    """
    return np.asarray(way_m > _ERROR_M + _RUNNING_MPS * gap_s)


def catch_up(stood: np.ndarray, way_m: np.ndarray, gap_s: np.ndarray) -> np.ndarray:
    """Which steps make good for positions that were repeated under new stamps, as by a slow detector.

    Args:
        stood: whether the detections before each step are at exactly one place. [N] bool
        way_m: length of the step, m. [N]
        gap_s: time that it took, s. [N]

    Returns:
        [N] bool
    """
    return np.asarray(stood & (way_m > np.maximum(_LEAST_M, _CATCHING_UP_MPS * gap_s)))
