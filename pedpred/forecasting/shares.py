"""Which shares of lines would have been best: sums of comparisons, and their minimum (`trust`)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pedpred.compiled import compiled
from pedpred.errors import ValueRuleError
from pedpred.forecasting.comparisons import GROUPS

LINES = 2
"""Lines that a point forecast may go to."""
_PRIOR, _MOST = 200.0, 10000.0
"""M, and the most forecasts that N counts: those of 100 people in half a minute."""
_ROUNDING = 1e-9
_NEAR_M = 0.02
"""c: errors below this, m, count as squares."""


class Sums(NamedTuple):
    """What comparisons add up to; for each of some people, or for none.

    Attributes:
        products: of d_l . d_m, weighted. [..., G, P, L, L]
        errors: of d_l . e, weighted. [..., G, P, L]
        compared: number of forecasts. [..., G]
    """

    products: np.ndarray
    errors: np.ndarray
    compared: np.ndarray

    @classmethod
    def nothing(cls, steps: int, *people: int) -> Sums:
        """Before the first comparison, for so many people."""
        each = (*people, GROUPS)
        products, errors = np.zeros((*each, steps, LINES, LINES)), np.zeros((*each, steps, LINES))
        return cls(products, errors, np.zeros(each))

    def with_comparisons(
        self, weights: np.ndarray, row: np.ndarray, group: np.ndarray, apart: np.ndarray, error: np.ndarray
    ) -> Sums:
        """The sums of some people after forecasts of these have been compared.

        Args:
            weights: w for each of the people. [K, G, P, L]
            row: who of them was forecast. [N]
            group: see `groups_of`. [N]
            apart: from the point forecast to the lines, m. [N, L, P, 2]
            error: from there to the position, m; forecasts of which a step is NaN do not count. [N, P, 2]
        """
        sums = Sums(*(values.copy() for values in self))
        _add(*sums, weights, row, group, apart, error)
        return sums.faded()

    def faded(self) -> Sums:
        """The same mean with no more than the most forecasts."""
        fades = np.minimum(1.0, _MOST / np.maximum(self.compared, 1.0))
        return Sums(
            self.products * fades[..., None, None, None],
            self.errors * fades[..., None, None],
            self.compared * fades,
        )

    def best_weights(self) -> np.ndarray:
        """The shares w that minimise the sum. [..., G, P, L]."""
        prior = (_PRIOR / np.maximum(self.compared, 1.0))[..., None, None, None] * np.eye(LINES)
        return best_weights(self.products * (1.0 + prior), self.errors)


def check_sums(sums: Sums) -> None:
    """Check that sums may be those of some forecasts.

    Raises:
        ValueRuleError: they are not.
    """
    squares = np.diagonal(sums.products, axis1=-2, axis2=-1)
    both, other = sums.products[..., 0, 1], sums.products[..., 1, 0]
    equal, most = _ROUNDING * squares.sum(axis=-1), squares.prod(axis=-1) * (1.0 + _ROUNDING)
    if not ((squares >= 0).all() and (np.abs(both - other) <= equal).all() and (both**2 <= most).all()):
        raise ValueRuleError("trust.products", None, "they must be symmetric, without negative eigenvalues")
    if not ((sums.compared >= 0).all() and (sums.compared <= _MOST * (1.0 + _ROUNDING)).all()):
        raise ValueRuleError("trust.compared", sums.compared.tolist(), f"it must be in [0, {_MOST:g}]")


@compiled
def _add(products, errors, compared, weights, row, group, apart, error):  # pragma: no cover (compiled)
    """Add to the sums in place; see `Sums.with_comparisons`."""
    people, lines, steps = apart.shape[:3]
    for n in range(people):
        if np.isnan(error[n]).any():
            continue
        k, g = row[n], group[n]
        compared[k, g] += 1.0
        for p in range(steps):
            x, y = error[n, p]
            left_x, left_y = x, y
            for line in range(lines):
                left_x -= weights[k, g, p, line] * apart[n, line, p, 0]
                left_y -= weights[k, g, p, line] * apart[n, line, p, 1]
            weight = 1.0 / (_NEAR_M + math.hypot(left_x, left_y))
            for line in range(lines):
                far_x, far_y = weight * apart[n, line, p, 0], weight * apart[n, line, p, 1]
                errors[k, g, p, line] += far_x * x + far_y * y
                for other in range(lines):
                    product = far_x * apart[n, other, p, 0] + far_y * apart[n, other, p, 1]
                    products[k, g, p, line, other] += product


def best_weights(products: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Minimise w A w / 2 - b w over w_1, w_2 >= 0 with w_1 + w_2 <= 1.

    Args:
        products: A, symmetric and without negative eigenvalues. [..., 2, 2]
        errors: b. [..., 2]

    Returns:
        w; 0 where A is 0. [..., 2]
    """
    weights = np.zeros(errors.shape)
    _minimise(products.reshape(-1, 2, 2), errors.reshape(-1, 2), weights.reshape(-1, 2))
    return weights


@compiled
def _minimise(products, errors, weights):  # pragma: no cover (compiled)
    """Write the best weights: those of the minimum, if it is in the triangle, or of the best edge."""
    for n in range(len(errors)):
        first, second, both = products[n, 0, 0], products[n, 1, 1], products[n, 0, 1]
        b, c, least = errors[n, 0], errors[n, 1], 0.0
        size, tilt = first * second - both * both, first + second - 2.0 * both
        share = min(max(_ratio(b - c + second - both, tilt), 0.0), 1.0)
        one, two = min(max(_ratio(b, first), 0.0), 1.0), min(max(_ratio(c, second), 0.0), 1.0)
        inside = _ratio(second * b - both * c, size), _ratio(first * c - both * b, size)
        for w, v in (inside, (one, 0.0), (0.0, two), (share, 1.0 - share)):
            loss = 0.5 * (first * w * w + second * v * v) + both * w * v - b * w - c * v
            if w >= 0.0 and v >= 0.0 and w + v <= 1.0 and loss < least:
                weights[n, 0], weights[n, 1], least = w, v, loss


@compiled
def _ratio(above, below):  # pragma: no cover (compiled)
    """Quotient; 0 where the divisor is not positive."""
    return above / below if below > 0.0 else 0.0
