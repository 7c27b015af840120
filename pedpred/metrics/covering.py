"""Twenty paths that cover a forecast: what "best of 20" is measured on.

The measure asks how near the nearest of 20 paths comes to the truth, so that random draws waste most of them.
The paths here are chosen from the forecast alone: of many evenly spread draws, those 20 from which a draw is
nearest in the mean (k-means with the mean distance over the steps, a quantiser of the forecast distribution).
"""

from __future__ import annotations

import numpy as np

from pedpred.compiled import compiled
from pedpred.errors import ValueRuleError
from pedpred.scenes import Predictions

_DRAWS = 384
_ROUNDS = 12
_RATIO = 1.2207440846057596
"""x^4 = x + 1: powers of its inverse spread most evenly in three dimensions (Roberts 2018)."""


def covering_paths(predictions: Predictions, count: int = 20) -> np.ndarray:
    """Choose paths that cover the forecasts; the same forecasts give the same paths.

    Args:
        predictions: with covariances. [W]
        count: number of paths S.

    Returns:
        World frame, m. [W, S, P, 2]

    Raises:
        ValueRuleError: there are no covariances.
    """
    share, noise = even_draws(_DRAWS)
    if predictions.covariance is None:
        raise ValueRuleError("covariance", None, "only forecasts with covariances spread")
    root = np.linalg.cholesky(predictions.covariance)
    chosen = np.empty((len(predictions), count, predictions.steps, 2))
    _cover(predictions.path, root, np.cumsum(predictions.weight, axis=1), share, noise, _ROUNDS, chosen)
    return chosen


def even_draws(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Evenly spread numbers in [0, 1) [D] and pairs of normal ones [D, 2], by an additive recurrence."""
    steps = _RATIO ** -np.arange(1, 4)
    even = (0.5 + np.outer(np.arange(1, count + 1), steps)) % 1.0
    away, turn = np.sqrt(-2.0 * np.log1p(-even[:, 1])), 2.0 * np.pi * even[:, 2]
    noise = away[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    return np.ascontiguousarray(even[:, 0]), noise


@compiled
def _cover(path, root, upto, share, noise, rounds, chosen):  # pragma: no cover (compiled)
    """Lloyd's algorithm per window, until nothing changes. Writes into `chosen`."""
    draws, (count, steps) = len(share), chosen.shape[1:3]
    paths = np.empty((draws, steps, 2))
    nearest = np.empty(draws, np.int64)
    centres = np.empty((steps, 2, count))  # centres last: distances to all of them at once
    away = np.empty(count)
    for w in range(len(path)):
        for d in range(draws):
            k = 0
            while k < path.shape[1] - 1 and share[d] * upto[w, -1] >= upto[w, k]:
                k += 1
            for p in range(steps):
                for axis in range(2):
                    paths[d, p, axis] = path[w, k, p, axis]
                    for other in range(axis + 1):
                        paths[d, p, axis] += root[w, k, p, axis, other] * noise[d, other]
        for c in range(count):
            chosen[w, c] = paths[c * draws // count]
        nearest[:] = -1
        for _ in range(rounds):
            for c in range(count):
                for p in range(steps):
                    centres[p, 0, c], centres[p, 1, c] = chosen[w, c, p]
            changed = False
            for d in range(draws):
                away[:] = 0.0
                for p in range(steps):
                    x, y = paths[d, p]
                    for c in range(count):
                        dx, dy = x - centres[p, 0, c], y - centres[p, 1, c]
                        away[c] += np.sqrt(dx * dx + dy * dy)
                least = away.argmin()
                changed |= least != nearest[d]
                nearest[d] = least
            if not changed:
                break
            for c in range(count):
                taken = 0
                for d in range(draws):
                    if nearest[d] == c:
                        if taken == 0:
                            chosen[w, c] = 0.0
                        taken += 1
                        chosen[w, c] += paths[d]
                if taken > 0:
                    chosen[w, c] /= taken
