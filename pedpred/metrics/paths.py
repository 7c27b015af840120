"""Distances between paths. Any order, any batch."""

from __future__ import annotations

import numpy as np

SAME_INSTANT_S = 1e-6


def displacement(paths: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Euclidean distance of positions, m. [..., 2] x 2, broadcast -> [...]."""
    return np.linalg.norm(paths - truth, axis=-1)


def too_close(paths: np.ndarray, time_s: np.ndarray, distance_m: float) -> np.ndarray:
    """Find forecasts that come too close to another forecast made at the same instant.

    Args:
        paths: world frame, m. [W, P, 2]
        time_s: instant of each forecast, s. [W]
        distance_m: two people nearer than this at the same step collide, m.

    Returns:
        [W] bool
    """
    hit = np.zeros(len(paths), dtype=bool)
    order = np.argsort(time_s, kind="stable")
    edges = np.flatnonzero(np.diff(time_s[order]) > SAME_INSTANT_S) + 1
    for rows in np.split(order, edges):
        if len(rows) > 1:
            gap = displacement(paths[rows, None], paths[None, rows]).min(axis=-1)
            np.fill_diagonal(gap, np.inf)
            hit[rows] = gap.min(axis=1) < distance_m
    return hit
