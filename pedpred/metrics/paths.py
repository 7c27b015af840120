"""Distances between paths. Any order, any batch."""

from __future__ import annotations

import math

import numpy as np

from pedpred.compiled import compiled

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
    edges = np.flatnonzero(np.diff(time_s[order], prepend=-np.inf, append=np.inf) > SAME_INSTANT_S)
    hit[order] = _meet(paths[order], edges, distance_m)
    return hit


@compiled
def _meet(paths: np.ndarray, edges: np.ndarray, distance_m: float) -> np.ndarray:  # pragma: no cover
    """`too_close` for instants that begin at each edge and end at the next one. [W]."""
    hit = np.zeros(len(paths), np.bool_)
    for group in range(len(edges) - 1):
        for one in range(edges[group], edges[group + 1]):
            for other in range(one + 1, edges[group + 1]):
                for p in range(paths.shape[1]):
                    x = paths[one, p, 0] - paths[other, p, 0]
                    y = paths[one, p, 1] - paths[other, p, 1]
                    if math.sqrt(x * x + y * y) < distance_m:
                        hit[one] = hit[other] = True
                        break
    return hit
