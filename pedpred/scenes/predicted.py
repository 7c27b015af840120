"""Predicted occupancy: where on a grid somebody will be, step by step, as planners read it."""

from __future__ import annotations

import math

import numpy as np

from pedpred.arrays import real_number
from pedpred.compiled import compiled
from pedpred.errors import ValueRuleError, shape_error
from pedpred.scenes.occupancy import OccupancyMap
from pedpred.scenes.predictions import Predictions

BODY_M = 0.3
"""Radius of a person, m."""

_MOST_CELLS, _WIDEST_BODY = 2**24, 32
"""Cells of all steps, and in the radius of a person: the time grows with the fourth power of the latter."""
_BLUR = 0.6
"""Standard deviation added to every forecast, in cells, so that sums over cells are integrals."""
_POINTS = 11
"""Points per side of a cell that measure its covered share."""
_REACH = 4.0
"""Standard deviations of a forecast beyond which nobody is expected."""


def predicted_occupancy(predictions: Predictions, grid: OccupancyMap, body_m: float = BODY_M) -> np.ndarray:
    """Give the probability that a person covers a point of a cell, at each step. [P, X, Y] float32.

    Person n is within `body_m` of a point with probability p_n, from its weighted modes and their
    covariances; without these its modes are exact. People are independent: 1 - prod_n (1 - p_n).

    Args:
        predictions: world frame. W people, P steps; rows with NaN are left out.
        grid: the cells; its obstacles do not matter.
        body_m: radius of a person, m.

    Raises:
        ValueRuleError: the predictions are not in the world frame, the radius is not positive, or cells are
            too many, or much smaller than it.
    """
    if predictions.frame != "world":
        raise ValueRuleError("frame", predictions.frame, "it must be 'world'")
    if not 0 < real_number("body_m", body_m) < np.inf:
        raise ValueRuleError("body_m", body_m, "it must be positive")
    if body_m > _WIDEST_BODY * grid.resolution_m:
        rule = f"{body_m} m, the radius of a person, must be at most {_WIDEST_BODY} cells: use larger cells"
        raise ValueRuleError("grid.resolution_m", grid.resolution_m, rule)
    shape = (predictions.steps, *grid.occupied.shape)
    if math.prod(shape) > _MOST_CELLS:
        raise shape_error("grid", shape, f"at most {_MOST_CELLS} cells of all steps: use larger cells")
    body = _disc(body_m / grid.resolution_m)
    free = np.ones(shape, np.float32)
    known = np.isfinite(predictions.path).all(axis=(1, 2, 3))
    path = (predictions.path[known] - grid.origin) / grid.resolution_m - 0.5
    spread = np.zeros((*path.shape, 2)) if predictions.covariance is None else predictions.covariance[known]
    spread = spread / grid.resolution_m**2 + _BLUR**2 * np.eye(2)
    for person, weight in enumerate(predictions.weight[known]):
        for step in range(predictions.steps):
            _cover(free[step], path[person, :, step], spread[person, :, step], weight, body)
    return 1.0 - free


def _disc(radius: float) -> np.ndarray:
    """Share of each cell that a disc around the middle of a grid covers; unit: cells. [D, D]."""
    rim = math.ceil(radius - 0.5)
    points = (np.arange((2 * rim + 1) * _POINTS) + 0.5) / _POINTS - rim - 0.5
    inside = np.hypot(points[:, None], points) <= radius
    share = inside.reshape(2 * rim + 1, _POINTS, -1, _POINTS).mean(axis=(1, 3))
    return np.asarray(share * np.pi * radius**2 / share.sum())


def _cover(
    free: np.ndarray, mean: np.ndarray, covariance: np.ndarray, weight: np.ndarray, body: np.ndarray
) -> None:
    """Multiply a grid by the probability that one person leaves each cell free. Units are cells.

    Args:
        free: probability that a cell is free, changed in place. [X, Y]
        mean: of the modes; cell (i, j) has its centre at (i, j). [K, 2]
        covariance: of the modes. [K, 2, 2]
        weight: of the modes. [K]
        body: share of each cell that a person in the middle covers. [D, D]
    """
    rim = len(body) // 2
    wide = _REACH * np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    low = np.maximum(np.floor((mean - wide).min(axis=0)), -rim)
    high = np.minimum(np.ceil((mean + wide).max(axis=0)), np.array(free.shape) - 1 + rim)
    if (low > high).any():
        return
    (left, bottom), (right, top) = (end.astype(np.int64) for end in (low - rim, high + rim + 1))
    dx = np.arange(left, right) - mean[:, :1]
    dy = np.arange(bottom, top) - mean[:, 1:]
    inverse = np.linalg.inv(covariance)
    distance2 = (
        (inverse[:, :1, :1] * dx[..., None] ** 2)
        + 2 * inverse[:, :1, 1:] * dx[..., None] * dy[:, None]
        + (inverse[:, 1:, 1:] * dy[:, None] ** 2)
    )
    scale = weight / (2 * np.pi * np.sqrt(np.linalg.det(covariance)))
    share = _convolved(np.tensordot(scale, np.exp(-0.5 * distance2), 1), body)
    inside = np.s_[max(left, 0) : max(right, 0), max(bottom, 0) : max(top, 0)]
    window = free[inside]
    cut = share[max(-left, 0) :, max(-bottom, 0) :][: window.shape[0], : window.shape[1]]
    window *= 1.0 - np.minimum(cut, 1.0)


@compiled
def _convolved(density, body):  # pragma: no cover (compiled)
    """Convolve a density [X, Y] with a body [D, D] that is its own mirror image; it is 0 outside. [X, Y]."""
    width, height = density.shape
    rim = len(body) // 2
    total = np.zeros((width, height))
    for x in range(width):
        for i in range(max(rim - x, 0), min(len(body), width + rim - x)):
            for j in range(len(body)):
                share, shift = body[i, j], j - rim
                for y in range(max(0, -shift), min(height, height - shift)):
                    total[x, y] += share * density[x + i - rim, y + shift]
    return total
