"""Pure measures of forecast paths. Any order, any batch."""

from __future__ import annotations

import numpy as np

from pedpred.scenes import OccupancyMap


def displacement(paths: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Euclidean error of every forecast position, m. [W, P, 2] x 2 -> [W, P]."""
    return np.linalg.norm(paths - truth, axis=-1)


def inside_obstacle(paths: np.ndarray, occupancy: OccupancyMap) -> np.ndarray:
    """Which forecast positions lie in an occupied cell. [W, P, 2] m, world -> [W, P] bool."""
    return occupancy.is_occupied(paths)


def too_close(paths: np.ndarray, time_s: np.ndarray, distance_m: float) -> np.ndarray:
    """Which forecasts run into another forecast made at the same instant.

    Args:
        paths: world frame, m. [W, P, 2]
        time_s: instant of each forecast, s. [W]
        distance_m: two people nearer than this at the same step collide, m.

    Returns:
        [W] bool
    """
    hit = np.zeros(len(paths), dtype=bool)
    order = np.argsort(time_s, kind="stable")
    edges = np.flatnonzero(np.diff(time_s[order]) > 1e-6) + 1
    for rows in np.split(order, edges):
        if len(rows) > 1:
            gap = np.linalg.norm(paths[rows, None] - paths[None, rows], axis=-1).min(axis=-1)
            np.fill_diagonal(gap, np.inf)
            hit[rows] = gap.min(axis=1) < distance_m
    return hit


def bootstrap_interval(
    values: np.ndarray, track: np.ndarray, samples: int, rng: np.random.Generator
) -> tuple[float, float]:
    """95 % interval of a mean over windows, resampling whole tracks.

    Windows of one track are not independent; tracks nearly are.

    Args:
        values: one per window. [W]
        track: which track each window belongs to. [W]
        samples: bootstrap replicates.
        rng: draws them.
    """
    if not len(values):
        return float("nan"), float("nan")
    _, index = np.unique(track, return_inverse=True)
    sums, counts = np.bincount(index, weights=values), np.bincount(index)
    tracks = len(counts)
    weights = rng.multinomial(tracks, np.full(tracks, 1.0 / tracks), size=samples)
    low, high = np.percentile((weights @ sums) / (weights @ counts), [2.5, 97.5])
    return float(low), float(high)
