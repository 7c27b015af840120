"""Fewer modes that forecast nearly the same: the two that are most alike are merged, again and again.

Alike is what changes the forecast least when it is merged (Runnalls 2007, IEEE Transactions
on Aerospace and Electronic Systems 43(3), eq. 21). For modes i and j, averaged over the steps:
    B(i, j) = ((w_i + w_j) ln det C - w_i ln det C_i - w_j ln det C_j) / 2
with C the covariance of both together. A merged mode has the weight, mean and covariance of its parts.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pedpred.compiled import compiled
from pedpred.scenes import Predictions

MOST_MODES = 6
"""A forecast has at most so many modes."""
_ALIKE = 1e-3  # relative difference of costs that count as equal
_SAME = 1e-6  # cost per weight of modes that count as the same
_AT_ONCE = 8  # determinants whose product is within the range of a float


def merge_modes(predictions: Predictions, most: int = MOST_MODES) -> Predictions:
    """Merge modes until there are at most `most`.

    Equally good merges are made at once, so that a forecast that is its own mirror image stays one; if too
    few modes are left, the most likely one is given twice, with half of its weight.

    Args:
        predictions: of any people, with finite paths and valid covariances.
        most: modes that remain, at least 1.

    Returns:
        The same predictions if they have no more modes, or no covariances.
    """
    if predictions.covariance is None or predictions.modes <= most:
        return predictions
    modes = predictions.path, predictions.covariance, predictions.weight
    path, covariance, weight = (np.array(values, np.float64, order="C") for values in modes)
    _reduce(path, covariance, weight, most)
    order = np.argsort(-weight, axis=1, kind="stable")[:, :most]
    at = np.arange(len(weight))[:, None], order
    return replace(predictions, path=path[at], weight=weight[at], covariance=covariance[at])


@compiled
def _reduce(path, covariance, weight, most):  # pragma: no cover (compiled)
    """Merge modes in place; those that are left over get the weight 0.

    Args:
        path: of the modes, m. [W, K, P, 2]
        covariance: m^2. [W, K, P, 2, 2]
        weight: positive. [W, K]
        most: modes that remain.
    """
    rows, modes = weight.shape
    cost, size = np.empty((modes, modes)), np.empty(modes)
    group, changed = np.empty(modes, np.int64), np.empty(modes, np.bool_)
    for row in range(rows):
        x, c, w = path[row], covariance[row], weight[row]
        left = modes
        for k in range(modes):
            changed[k] = True
        for _ in range(modes - most):  # each round merges some
            if left <= most:
                break
            _price(x, c, w, changed, size, cost)
            _group(w, cost, group)
            for j in range(modes):
                changed[j] = False
            for j in range(modes):
                if group[j] != j:
                    _merge(x, c, w, group[j], j)
                    changed[group[j]], left = True, left - 1
        for _ in range(most - left):
            first, free = np.argmax(w), np.argmin(w)
            for p in range(len(x[free])):  # number by number: assigning arrays takes seconds to compile
                for k in range(2):
                    x[free, p, k] = x[first, p, k]
                    c[free, p, k, 0], c[free, p, k, 1] = c[first, p, k, 0], c[first, p, k, 1]
            w[free] = w[first] = 0.5 * w[first]


@compiled
def _price(x, c, w, changed, size, cost):  # pragma: no cover (compiled)
    """Update the costs B(i, j) of modes that have changed, for j < i; inf where there is no mode."""
    for i in range(len(w)):
        if changed[i]:
            size[i] = _log_size(c[i])
    for i in range(len(w)):
        for j in range(i):
            if w[i] == 0.0 or w[j] == 0.0:
                cost[i, j] = np.inf
            elif changed[i] or changed[j]:
                cost[i, j] = _cost(x, c, w, size, i, j)


@compiled
def _group(w, cost, group):  # pragma: no cover (compiled)
    """Write the least mode that each is to be merged with, through all pairs of the least cost.

    The pair of the least cost itself always counts, whatever rounding makes of the limit.
    """
    least, one, other = np.inf, 0, 0
    for i in range(len(w)):
        group[i] = i
        for j in range(i):
            if cost[i, j] < least:
                least, one, other = cost[i, j], i, j
    for i in range(len(w)):
        for j in range(i):
            near = cost[i, j] <= least * (1.0 + _ALIKE) + _SAME * (w[i] + w[j])
            if near or (i == one and j == other):
                first, second = min(group[i], group[j]), max(group[i], group[j])
                for k in range(len(w)):
                    if group[k] == second:
                        group[k] = first


@compiled
def _log_size(c):  # pragma: no cover (compiled)
    """Mean of ln det C over the steps. [P, 2, 2] -> number."""
    total, product = 0.0, 1.0
    for p in range(len(c)):
        product *= c[p, 0, 0] * c[p, 1, 1] - c[p, 0, 1] * c[p, 1, 0]
        if p % _AT_ONCE == _AT_ONCE - 1:
            total, product = total + np.log(product), 1.0
    return (total + np.log(product)) / len(c)


@compiled
def _cost(x, c, w, size, i, j):  # pragma: no cover (compiled)
    """B(i, j)."""
    both = w[i] + w[j]
    one, other = w[i] / both, w[j] / both
    total, product = 0.0, 1.0
    for p in range(len(c[i])):
        dx, dy = x[i, p, 0] - x[j, p, 0], x[i, p, 1] - x[j, p, 1]
        a = one * c[i, p, 0, 0] + other * c[j, p, 0, 0] + one * other * dx * dx
        b = one * c[i, p, 0, 1] + other * c[j, p, 0, 1] + one * other * dx * dy
        d = one * c[i, p, 1, 1] + other * c[j, p, 1, 1] + one * other * dy * dy
        product *= a * d - b * b
        if p % _AT_ONCE == _AT_ONCE - 1:
            total, product = total + np.log(product), 1.0
    return 0.5 * (both * (total + np.log(product)) / len(c[i]) - w[i] * size[i] - w[j] * size[j])


@compiled
def _merge(x, c, w, i, j):  # pragma: no cover (compiled)
    """Make mode i both modes together, and j nothing."""
    both = w[i] + w[j]
    one, other = w[i] / both, w[j] / both
    for p in range(len(c[i])):
        dx, dy = x[j, p, 0] - x[i, p, 0], x[j, p, 1] - x[i, p, 1]
        for a in range(2):
            for b in range(2):
                c[i, p, a, b] = one * c[i, p, a, b] + other * c[j, p, a, b]
        c[i, p, 0, 0] += one * other * dx * dx
        c[i, p, 0, 1] += one * other * dx * dy
        c[i, p, 1, 0] += one * other * dx * dy
        c[i, p, 1, 1] += one * other * dy * dy
        x[i, p, 0] += other * dx
        x[i, p, 1] += other * dy
    w[i], w[j] = both, 0.0
