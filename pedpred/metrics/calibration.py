"""Calibration of forecasts: likelihood of the truth, and coverage of regions of probability."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pedpred.compiled import compiled
from pedpred.scenes import Predictions

_GOLDEN_RAD = math.pi * (3.0 - math.sqrt(5.0))

REGIONS = (0.5, 0.9, 0.95)
"""Shares of the probability that the reported regions hold."""


def squared_mahalanobis(error: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Distance in units of the covariance, d^2 = e^T Sigma^-1 e.

    Args:
        error: true minus forecast position, m. [..., 2]
        covariance: of the forecast position, same frame, m^2. [..., 2, 2]

    Returns:
        [...]
    """
    (a, b), (_, d) = np.moveaxis(covariance, (-2, -1), (0, 1))
    x, y = error[..., 0], error[..., 1]
    return (d * x * x - 2.0 * b * x * y + a * y * y) / (a * d - b * b)


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
    from scipy.special import logsumexp  # late: a robot has no SciPy

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


class Points(NamedTuple):
    """Points that stand for a standard Gaussian.

    Attributes:
        offset: [N, 2]
        mass: their probabilities. [N]
        density: there, in units of the highest. [N]
    """

    offset: np.ndarray
    mass: np.ndarray
    density: np.ndarray


def sunflower(bounds: np.ndarray) -> Points:
    """One point in each ring, at golden angles, so that few are enough.

    Args:
        bounds: shares of the probability within the bounds of the rings, from 0 to 1. [N + 1]
    """
    middle, place = 0.5 * (bounds[1:] + bounds[:-1]), np.arange(len(bounds) - 1) + 0.5
    radius, angle = np.sqrt(radius2(middle)), place * _GOLDEN_RAD
    offset = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    return Points(offset, np.diff(bounds), 1.0 - middle)


FINE = sunflower(np.linspace(0.0, 1.0, 65))
"""64 points of equal probability."""
COARSE = sunflower(
    np.array([*np.linspace(0.0, 0.5, 6), *np.linspace(0.5, 0.9, 6)[1:], 0.925, 0.95, 0.975, 1.0])
)
"""14 points for regions of 50, 90 and 95 %, which are bounds of rings."""


def share_inside(predictions: Predictions, truth: np.ndarray, points: Points = FINE) -> np.ndarray:
    """Share of the probability in the smallest region that reaches the truth; uniform where calibrated.

    That region is where the density is higher than at the truth: 1 - exp(-d^2 / 2) of a single Gaussian; of
    several modes, the weighted share of points of theirs that are more likely than the truth.

    Args:
        predictions: of W people, with covariances.
        truth: same frame, m. [W, P, 2]
        points: of each mode.

    Returns:
        [W, P]
    """
    assert predictions.covariance is not None
    centre, weight = predictions.path - truth[:, None], np.asarray(predictions.weight, np.float64)
    return _share_inside(centre, predictions.covariance, weight, points)


@compiled
def _share_inside(centre, covariance, weight, points):  # pragma: no cover (compiled)
    """Of modes [W, K, P, 2] around the truth. [W, P]."""
    rows, modes, steps = centre.shape[:3]
    share, limits, there = np.zeros((rows, steps)), np.zeros(0), np.empty((modes, 9))
    for row in range(rows):
        for step in range(steps):
            for mode in range(modes):
                (x, y), sigma = centre[row, mode, step], covariance[row, mode, step]
                write_component(there[mode], x, y, sigma[0, 0], sigma[1, 0], sigma[1, 1], weight[row, mode])
            share[row, step] = share_reached(there, points, limits)
    return share


@compiled
def write_component(row, x, y, xx, xy, yy, weight):  # pragma: no cover (compiled)
    """Fill a row for `share_reached`: a mode's mean, seen from the truth; its covariance; its weight.

    The row is the mean, L of Sigma = L L^T, the density at the mean (without 2 pi), the inverse diagonal
    of L, and the weight.
    """
    row[0], row[1] = x, y
    row[2] = math.sqrt(xx)
    row[3] = xy / row[2]
    row[4] = math.sqrt(yy - row[3] * row[3])
    row[5] = weight / (row[2] * row[4])
    row[6], row[7], row[8] = 1.0 / row[2], 1.0 / row[4], weight


@compiled
def share_reached(modes, points, limits):  # pragma: no cover (compiled)
    """`share_inside` of one truth; with limits, any value on the same side of each, which is faster.

    The points of a mode begin in the direction of the mean of all modes, so that they turn with the world.
    """
    here = left = middle_x = middle_y = 0.0
    rest = modes[:, 8].sum()
    for mode in range(len(modes)):
        here += _density(0.0, 0.0, modes[mode])
        left += modes[mode, 5]
        middle_x += modes[mode, 8] * modes[mode, 0] / rest
        middle_y += modes[mode, 8] * modes[mode, 1] / rest
    if len(modes) == 1:
        return 1.0 - here / left
    reached = 0.0
    for mode in range(len(modes)):
        component, inside = modes[mode], 0.0
        cos, sin = _direction(middle_x, middle_y, component)
        for k in range(len(points.offset)):
            u = cos * points.offset[k, 0] - sin * points.offset[k, 1]
            v = sin * points.offset[k, 0] + cos * points.offset[k, 1]
            x = component[0] + component[2] * u
            y = component[1] + component[3] * u + component[4] * v
            at_point = component[5] * points.density[k]
            if at_point > here or _denser(x, y, modes, mode, at_point, left - component[5], here):
                inside += points.mass[k]
        reached += component[8] * inside
        rest -= component[8]
        if len(limits) and not ((limits >= reached) & (limits < reached + rest)).any():
            break
    return reached


@compiled
def _denser(x, y, modes_there, excluded, density, left, here):  # pragma: no cover (compiled)
    """Whether `density` and that of the others exceed `here`; stops once the rest cannot change it."""
    for mode in range(len(modes_there)):
        if mode == excluded:
            continue
        if density + left <= here:
            return False
        density += _density(x, y, modes_there[mode])
        left -= modes_there[mode, 5]
        if density > here:
            return True
    return False


@compiled
def _standardised(x, y, component):  # pragma: no cover (compiled)
    """A point as seen from a mode, L^-1 (x - mu)."""
    u = (x - component[0]) * component[6]
    return u, (y - component[1] - component[3] * u) * component[7]


@compiled
def _direction(x, y, component):  # pragma: no cover (compiled)
    """Unit vector from a mode to a point, standardised; any if it is there."""
    u, v = _standardised(x, y, component)
    length = math.hypot(u, v)
    return (u / length, v / length) if length > 1e-9 else (1.0, 0.0)


@compiled
def _density(x, y, component):  # pragma: no cover (compiled)
    """Density of a mode at a point, up to the factor 2 pi."""
    u, v = _standardised(x, y, component)
    away = 0.5 * (u * u + v * v)
    return component[5] * math.exp(-away) if away < 40.0 else 0.0  # below rounding


def coverage(inside: np.ndarray, share: float) -> np.ndarray:
    """Share of the true positions in the regions that should hold `share` of them.

    Args:
        inside: see `share_inside`. [W, P]
        share: 0 to 1.

    Returns:
        [P]
    """
    return (inside <= share).mean(axis=0)


def shown_steps(steps: int) -> tuple[int, int, int]:
    """The first step of a horizon, its middle and its last: 0.3, 1.5 and 3 s of ten steps."""
    return 0, (steps - 1) // 2, steps - 1
