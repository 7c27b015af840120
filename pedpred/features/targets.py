"""What really happened: the true path after each step, from a spline through all annotations."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline


def true_path(time_s: np.ndarray, position: np.ndarray, query_s: np.ndarray) -> np.ndarray:
    """Positions of one track between its annotations (targets only, never an input).

    Args:
        time_s: annotated instants, rising, s. [A]
        position: annotations, world frame, m. [A, 2]
        query_s: any shape, s; clipped to the annotated span. [...]

    Returns:
        World frame, m. [..., 2]
    """
    query_s = np.clip(query_s, time_s[0], time_s[-1])
    if len(time_s) == 1:
        return np.broadcast_to(position[0], (*query_s.shape, 2))
    return CubicSpline(time_s, position)(query_s)


def future_velocities(position: np.ndarray, path: np.ndarray, dt_s: float) -> np.ndarray:
    """Velocities whose Euler integration from the tracked position lands on the true path.

    Args:
        position: tracked position at the step, m. [M, 2]
        path: true positions at the next P steps, same frame, m. [M, P, 2]
        dt_s: time between steps, s.

    Returns:
        m/s. [M, P, 2]
    """
    before = np.concatenate([position[:, None], path[:, :-1]], axis=1)
    return (path - before) / dt_s
