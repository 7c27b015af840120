"""Calibration of forecast covariances: likelihood of the truth, and coverage of error ellipses."""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp

from pedpred.scenes import Predictions

REGIONS = (0.5, 0.9, 0.95)
"""Shares of the probability that the reported error ellipses hold."""


def squared_mahalanobis(error: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Distance in units of the covariance, d^2 = e^T Sigma^-1 e.

    Args:
        error: true minus forecast position, m. [..., 2]
        covariance: of the forecast position, same frame, m^2. [..., 2, 2]

    Returns:
        [...]
    """
    return (error * np.linalg.solve(covariance, error[..., None])[..., 0]).sum(axis=-1)


def negative_log_likelihood(distance2: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Negative log density of a plane Gaussian, d^2 / 2 + ln(2 pi sqrt(det Sigma)), nats. [...].

    Args:
        distance2: see `squared_mahalanobis`. [...]
        covariance: m^2. [..., 2, 2]
    """
    return 0.5 * (distance2 + np.log(np.linalg.det(covariance))) + np.log(2 * np.pi)


def mixture_nll(predictions: Predictions, truth: np.ndarray) -> np.ndarray:
    """Negative log likelihood of each true position under the weighted Gaussian modes, nats.

    -ln sum_k w_k N(y | mu_k, Sigma_k), for densities per m^2.

    Args:
        predictions: of W people.
        truth: same frame, m. [W, P, 2]

    Returns:
        NaN from a method without covariances. [W, P]
    """
    if predictions.covariance is None:
        return np.full(truth.shape[:2], np.nan)
    distance2 = squared_mahalanobis(truth[:, None] - predictions.path, predictions.covariance)
    each = negative_log_likelihood(distance2, predictions.covariance)
    return -logsumexp(-each, axis=1, b=predictions.weight[..., None])


def radius2(share: np.ndarray | float) -> np.ndarray:
    """Squared Mahalanobis radius of the ellipse with a share p of a plane Gaussian, -2 ln(1 - p). [...].

    The quantile of the chi-squared distribution with two degrees of freedom.
    """
    return -2.0 * np.log1p(-np.asarray(share, dtype=np.float64))


def coverage(distance2: np.ndarray, share: float) -> np.ndarray:
    """Share of the true positions inside the ellipses that should hold `share` of them. [W, P] -> [P]."""
    return (distance2 <= radius2(share)).mean(axis=0)


def shown_steps(steps: int) -> tuple[int, int, int]:
    """The first step of a horizon, its middle and its last: 0.3, 1.5 and 3 s of ten steps."""
    return 0, (steps - 1) // 2, steps - 1
