"""How likely a robot overlaps a person, from forecasts with several modes and covariances.

Person n is at a step in mode k with probability w_nk, and there at x ~ N(mu_nk, Sigma_nk). The discs of the
person and the robot, of radii that sum to R, overlap if x is within R of the robot. Let r be the coordinate
of x along the line from the robot to mu, d = |mu - robot| its mean, and t the one across. With the standard
deviation sigma of r and the mean m and deviation s of t given that r = min(d, R),

    p_nk = [Phi((R - d) / sigma) - Phi((-R - d) / sigma)] [Phi((h - m) / s) - Phi((-h - m) / s)], h = pi R / 4

The disc is replaced by a rectangle 2 R x 2 h of the same area that looks at mu: p is 1 or 0 for an exact
forecast (|mu - robot| < R or not), and density times area for a wide one. In between
it is up to 0.12 too large, because the rectangle is wider than the disc near its rim, and up to 0.03 too
small. People are independent:

    P = 1 - prod_n (1 - sum_k w_nk p_nk)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pedpred.compiled import compiled
from pedpred.scenes import BODY_M, Forecast

_FAR = 4.0  # standard deviations beyond which nobody is expected
_SMALL_M = 1e-4  # deviation of forecasts without covariance
_HALF = math.sqrt(0.5)


class Expected(NamedTuple):
    """Where people are expected at each step of a plan.

    Attributes:
        mean: of each mode, world frame, m; NaN: nobody is there. [N, K, S, 2]
        covariance: (xx, xy, yy), m^2. [N, K, S, 3]
        far_m: a person is not expected farther than this from the mean, m. [N, K, S]
        weight: of the modes. [N, K]
    """

    mean: np.ndarray
    covariance: np.ndarray
    far_m: np.ndarray
    weight: np.ndarray


@dataclass(frozen=True)
class Steps:
    """The instants of a plan.

    Attributes:
        dt_s: time between two of them, s; the first one is this long after the present.
        count: S.
    """

    dt_s: float
    count: int


def expected(forecast: Forecast, steps: Steps, noise_m: float) -> Expected:
    """Interpolate a forecast at the instants of a plan; beyond its last step it stays as it is there.

    Args:
        forecast: of N people.
        steps: the instants.
        noise_m: standard deviation of where people are at present, for methods with covariances.
    """
    predictions = forecast.predictions
    path, dt_s = predictions.path, predictions.dt_s
    here = predictions.point[:, 0] - dt_s * forecast.velocity[:, 0]
    path = np.concatenate([np.broadcast_to(here[:, None, None], (*path.shape[:2], 1, 2)), path], axis=2)
    spread = np.zeros((*path.shape[:3], 3))
    if predictions.covariance is not None:
        spread[:, :, 1:] = predictions.covariance.reshape(*predictions.path.shape[:3], 4)[..., [0, 1, 3]]
        spread[:, :, 0, ::2] = noise_m**2
    at = np.minimum((np.arange(steps.count) + 1) * steps.dt_s / dt_s, predictions.steps)
    at = np.where(np.abs(at - np.round(at)) < 1e-6, np.round(at), at)
    low = at.astype(np.int64)
    high, share = np.ceil(at).astype(np.int64), (at - low)[:, None]
    mean = (1 - share) * path[:, :, low] + share * path[:, :, high]
    covariance = (1 - share) * spread[:, :, low] + share * spread[:, :, high]
    covariance[..., ::2] += _SMALL_M**2
    middle = 0.5 * (covariance[..., 0] + covariance[..., 2])
    half = 0.5 * (covariance[..., 0] - covariance[..., 2])
    widest = middle + np.hypot(half, covariance[..., 1])
    return Expected(
        np.ascontiguousarray(mean), covariance, _FAR * np.sqrt(widest), predictions.weight.astype(np.float64)
    )


@compiled
def _between(low, high):  # pragma: no cover (compiled)
    """Probability that a standard normal number is between two bounds."""
    return 0.5 * (math.erf(high * _HALF) - math.erf(low * _HALF))


@compiled
def overlap(x, y, xx, xy, yy, radius_m):  # pragma: no cover (compiled)
    """Probability that somebody is within a radius, see the module.

    Args:
        x: mean of the position relative to the robot, m.
        y: the same.
        xx: variance, m^2.
        xy: covariance, m^2.
        yy: variance, m^2.
        radius_m: R.
    """
    d = math.sqrt(x * x + y * y)
    c, s = (x / d, y / d) if d > 1e-9 else (1.0, 0.0)
    along = c * c * xx + 2 * c * s * xy + s * s * yy
    across = s * s * xx - 2 * c * s * xy + c * c * yy
    both = c * s * (yy - xx) + (c * c - s * s) * xy
    sigma = math.sqrt(along)
    first = _between((-radius_m - d) / sigma, (radius_m - d) / sigma)
    m = both / along * (min(d, radius_m) - d)
    rest = math.sqrt(max(across - both * both / along, 1e-12))
    half = 0.25 * math.pi * radius_m
    return first * _between((-half - m) / rest, (half - m) / rest)


@compiled
def within_reach(people, x, y, speed_mps, dt_s, radius_m):  # pragma: no cover (compiled)
    """Whom a robot can overlap at each step of a plan, mode by mode.

    Args:
        people: an `Expected`.
        x: of the robot now, world frame, m.
        y: the same.
        speed_mps: its largest speed.
        dt_s: time between two steps, s.
        radius_m: R.

    Returns:
        Number of pairs of a person and a mode at each step [S], and the pairs, person by person [S, N K, 2].
    """
    persons, modes, steps = people.far_m.shape
    count, pairs = np.zeros(steps, np.int64), np.empty((steps, persons * modes, 2), np.int64)
    for n in range(persons):
        for k in range(modes):
            for s in range(steps):
                d_x, d_y = people.mean[n, k, s, 0] - x, people.mean[n, k, s, 1] - y
                reach = radius_m + people.far_m[n, k, s] + (s + 1) * dt_s * speed_mps
                if d_x * d_x + d_y * d_y < reach * reach:
                    pairs[s, count[s], 0], pairs[s, count[s], 1] = n, k
                    count[s] += 1
    return count, pairs


@compiled
def risk_at(step, x, y, to_x, to_y, people, near, radius_m):  # pragma: no cover (compiled)
    """Probabilities that a robot overlaps somebody at a step: anybody, and somebody whom it drives towards.

    Args:
        step: of the plan.
        x: of the robot, world frame, m.
        y: the same.
        to_x: how far it has moved in this step, m.
        to_y: the same.
        people: an `Expected`.
        near: pairs of `within_reach`.
        radius_m: R.
    """
    free, free_ahead, anyway, ahead, person = 1.0, 1.0, 0.0, 0.0, -1
    moved = math.sqrt(to_x * to_x + to_y * to_y)
    count, pairs = near
    for z in range(count[step]):
        n, k = pairs[step, z, 0], pairs[step, z, 1]
        d_x, d_y = people.mean[n, k, step, 0] - x, people.mean[n, k, step, 1] - y
        square, reach = d_x * d_x + d_y * d_y, radius_m + people.far_m[n, k, step]
        if not square < reach * reach:
            continue
        if n != person:
            free, free_ahead = free * (1.0 - min(anyway, 1.0)), free_ahead * (1.0 - min(ahead, 1.0))
            anyway, ahead, person = 0.0, 0.0, n
        spread = people.covariance[n, k, step]
        share = people.weight[n, k] * overlap(d_x, d_y, spread[0], spread[1], spread[2], radius_m)
        anyway += share
        b_x = people.mean[n, k, max(step - 1, 0), 0] - x + to_x  # where a runner was before this step
        b_y = people.mean[n, k, max(step - 1, 0), 1] - y + to_y
        now, before = d_x * to_x + d_y * to_y, b_x * to_x + b_y * to_y
        behind = now < -0.3 * math.sqrt(square) * moved and not before > -0.3 * math.hypot(b_x, b_y) * moved
        if moved > 1e-9 and not behind:
            ahead += share
    return 1.0 - free * (1.0 - min(anyway, 1.0)), 1.0 - free_ahead * (1.0 - min(ahead, 1.0))


def contact_m(robot_m: float) -> float:
    """Distance at which the discs of a robot and a person touch, m."""
    return robot_m + BODY_M
