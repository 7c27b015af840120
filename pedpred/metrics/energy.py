"""The sums over pairs of draws behind the energy score."""

from __future__ import annotations

import math

import numpy as np

from pedpred.compiled import compiled


@compiled
def energy_scores(
    path: np.ndarray, root: np.ndarray, weight: np.ndarray, noise: np.ndarray, truth: np.ndarray
) -> np.ndarray:  # pragma: no cover (compiled)
    """E|X - y| - E|X - X'| / 2, mean over the steps; see `pedpred.metrics.table.energy_score`.

    X and X' run over the modes and the draws of each; X' is shifted by one draw, which makes it independent.

    Args:
        path: modes, m. [W, K, P, 2]
        root: Cholesky factors of their covariances; zeros without, m. [W, K, P, 2, 2]
        weight: of the modes. [W, K]
        noise: standard normal numbers, a pair for each draw. [D, 2]
        truth: m. [W, P, 2]

    Returns:
        m. [W]
    """
    windows, modes, steps = path.shape[:3]
    draws = len(noise)
    drawn = np.empty((modes, draws, steps, 2))
    scores = np.zeros(windows)
    for w in range(windows):
        for k in range(modes):
            far = 0.0
            for d in range(draws):
                for p in range(steps):
                    for axis in range(2):
                        factor = root[w, k, p, axis]
                        moved = factor[0] * noise[d, 0] + factor[1] * noise[d, 1]
                        drawn[k, d, p, axis] = path[w, k, p, axis] + moved
                    x, y = drawn[k, d, p, 0] - truth[w, p, 0], drawn[k, d, p, 1] - truth[w, p, 1]
                    far += math.sqrt(x * x + y * y)
            scores[w] += weight[w, k] * far / (draws * steps)
        for i in range(modes):
            for j in range(modes):
                apart = 0.0
                for d in range(draws):
                    for p in range(steps):
                        x = drawn[i, d, p, 0] - drawn[j, d - 1, p, 0]
                        y = drawn[i, d, p, 1] - drawn[j, d - 1, p, 1]
                        apart += math.sqrt(x * x + y * y)
                scores[w] -= 0.5 * weight[w, i] * weight[w, j] * apart / (draws * steps)
    return scores
