"""The expectations behind the energy score."""

from __future__ import annotations

import math

import numpy as np

from pedpred.compiled import compiled


@compiled
def energy_scores(
    path: np.ndarray, covariance: np.ndarray, weight: np.ndarray, points: np.ndarray, truth: np.ndarray
) -> np.ndarray:  # pragma: no cover (compiled)
    """E|X - y| - E|X - X'| / 2, mean over the steps; see `pedpred.metrics.table.energy_score`.

    The difference of independent X and X' of modes i and j is Gaussian too: its mean is mu_i - mu_j, its
    covariance Sigma_i + Sigma_j.

    Args:
        path: modes, m. [W, K, P, 2]
        covariance: of them; zeros without, m^2. [W, K, P, 2, 2]
        weight: of the modes. [W, K]
        points: of equal probability, for a standard Gaussian. [N, 2]
        truth: m. [W, P, 2]

    Returns:
        m. [W]
    """
    windows, modes, steps = path.shape[:3]
    scores = np.zeros(windows)
    for w in range(windows):
        for p in range(steps):
            for i in range(modes):
                mean, sigma = path[w, i, p], covariance[w, i, p]
                scores[w] += weight[w, i] * _mean_length(mean - truth[w, p], sigma, points) / steps
                for j in range(i + 1):
                    pairs = 0.5 if i == j else 1.0  # (i, j) and (j, i)
                    apart = _mean_length(mean - path[w, j, p], sigma + covariance[w, j, p], points)
                    scores[w] -= pairs * weight[w, i] * weight[w, j] * apart / steps
    return scores


@compiled
def _mean_length(
    mean: np.ndarray, sigma: np.ndarray, points: np.ndarray
) -> float:  # pragma: no cover (compiled)
    """E|Z| of a Gaussian Z, or |mean| where sigma is zero, m."""
    if sigma[0, 0] == 0.0:
        return math.hypot(mean[0], mean[1])
    a = math.sqrt(sigma[0, 0])  # Cholesky factor (a, 0; b, c)
    b = sigma[1, 0] / a
    c = math.sqrt(sigma[1, 1] - b * b)
    length = 0.0
    for k in range(len(points)):
        x, y = mean[0] + a * points[k, 0], mean[1] + b * points[k, 0] + c * points[k, 1]
        length += math.sqrt(x * x + y * y)
    return length / len(points)
