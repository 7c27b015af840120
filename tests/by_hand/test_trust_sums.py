"""Shares of lines that would have been best: sums of comparisons, and their minimum, by hand."""

import numpy as np
import pytest

from pedpred.errors import ValueRuleError
from pedpred.forecasting.trust import Sums, best_weights


@pytest.mark.parametrize(
    ("products", "errors", "expected"),
    [
        ([[2.0, 0.5], [0.5, 1.0]], [0.7, 0.4], [2 / 7, 1.8 / 7]),  # A w = b, within the triangle
        ([[2.0, 0.0], [0.0, 1.0]], [0.5, -0.3], [0.25, 0.0]),  # on the edges: the first line alone
        ([[2.0, 1.5], [1.5, 3.0]], [-0.6, 1.2], [0.0, 0.4]),
        ([[2.0, 0.5], [0.5, 1.0]], [2.0, 1.0], [0.75, 0.25]),  # w + v = 1: (b - c + A_22 - A_12) / 2
        ([[2.0, 0.0], [0.0, 1.0]], [5.0, 0.1], [1.0, 0.0]),  # corners
        ([[2.0, 0.0], [0.0, 1.0]], [-1.0, 4.0], [0.0, 1.0]),
        ([[2.0, 0.0], [0.0, 1.0]], [-0.5, -0.1], [0.0, 0.0]),
        ([[0.0, 0.0], [0.0, 4.0]], [0.0, 1.0], [0.0, 0.25]),  # a line that is nowhere away
        ([[4.0, 0.0], [0.0, 0.0]], [1.0, 0.0], [0.25, 0.0]),
        ([[1.0, 1.0], [1.0, 1.0]], [0.4, 0.4], [0.4, 0.0]),  # the same line twice
        ([[2.0, -1.0], [-1.0, 1.5]], [0.2, 0.3], [0.3, 0.4]),  # lines on either side
        ([[1.0, 0.0], [0.0, 1.0]], [0.55, 0.5], [0.525, 0.475]),  # A w = b has a sum of 1.05
        ([[4.0, 4.47], [4.47, 5.0]], [4.2, 4.702], [0.0, 0.9404]),  # the best of three edges: -2.211
    ],
)
def test_shares_minimise_the_sum_over_the_triangle(products, errors, expected):
    """w A w / 2 - b w over w >= 0 with a sum of at most 1."""
    np.testing.assert_allclose(best_weights(np.array(products), np.array(errors)), expected, atol=1e-12)


def test_comparisons_add_products_over_their_errors():
    """1 / (0.02 m + |e - sum_l v_l d_l|) times d_l . d_m and d_l . e.

    The second person was compared once before. Forecasts of which one number is NaN do not count.
    """
    rng = np.random.default_rng(0)
    v, apart = rng.uniform(0, 0.5, (2, 3, 2)), rng.normal(size=(4, 2, 3, 2))
    error = rng.normal(size=(4, 3, 2))
    error[2, 1, 1] = np.nan
    before = Sums(*(np.full(s, 0.25) for s in ((2, 2, 3, 2, 2), (2, 2, 3, 2), (2, 2))))
    row, group = np.array([1, 0, 0, 1]), np.array([0, 1, 1, 0])
    after = before.with_comparisons(v, row, group, apart, error)
    expected = [np.full(values.shape, 0.25) for values in before]
    for k, g, d, e in ((1, 0, apart[0], error[0]), (0, 1, apart[1], error[1]), (1, 0, apart[3], error[3])):
        weight = 1 / (0.02 + np.linalg.norm(e - np.einsum("pl,lpa->pa", v[g], d), axis=-1))
        expected[0][k, g] += np.einsum("p,lpa,mpa->plm", weight, d, d)
        expected[1][k, g] += np.einsum("p,lpa,pa->pl", weight, d, e)
        expected[2][k, g] += 1
    for found, sums in zip(after, expected, strict=True):
        np.testing.assert_allclose(found, sums, rtol=1e-12)
    np.testing.assert_array_equal(before.products, 0.25)


@pytest.mark.parametrize(("count", "kept"), [(0.5, 1.0), (9999.0, 1.0), (10000.0, 1.0), (40000.0, 0.25)])
def test_more_than_10000_forecasts_fade(count, kept):
    sums = Sums(np.full((2, 1, 2, 2), 3.0), np.full((2, 1, 2), 5.0), np.array([7.0, count])).faded()
    assert sums.compared.tolist() == [7.0, kept * count]
    np.testing.assert_allclose(sums.errors[:, 0], [[5.0, 5.0], [5.0 * kept, 5.0 * kept]])
    np.testing.assert_allclose(
        sums.products[:, 0], np.array([3.0, 3.0 * kept])[:, None, None] * np.ones((2, 2))
    )


def test_comparisons_fade_what_was_before():
    """10000 forecasts and one more: all sums times 10000 / 10001."""
    sums = Sums(np.full((1, 2, 1, 2, 2), 8.0), np.full((1, 2, 1, 2), 6.0), np.full((1, 2), 10000.0))
    zero = np.zeros((1, 2, 1, 2)), np.zeros((1, 1, 2))
    after = sums.with_comparisons(np.zeros((2, 1, 2)), np.array([0]), np.array([1]), *zero)
    np.testing.assert_allclose(after.compared, [[10000.0, 10000.0]])
    np.testing.assert_allclose(after.errors[0, :, 0, 0], [6.0, 6.0 * 10000 / 10001])


@pytest.mark.parametrize("count", [400.0, 100.0, 1.0, 0.0])
def test_some_forecasts_draw_shares_to_0(count):
    """The second term adds M / N of its own to each square, none to products of both lines.

    M is 20 for people who stand still, else 100; or what is given for each row.
    """
    products, errors = np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([0.7, 0.4])
    sums = Sums(np.tile(products, (3, 1, 1, 1)), np.tile(errors, (3, 1, 1)), np.full(3, count))
    for found, prior in (
        (sums.best_weights(), (20, 100, 100)),
        (sums.best_weights(np.array([5, 6, 7])), (5, 6, 7)),
    ):
        for group in range(3):
            matrix = products + prior[group] / max(count, 1.0) * np.diag([2.0, 1.0])
            np.testing.assert_allclose(found[group, 0], np.linalg.solve(matrix, errors))


def test_before_the_first_comparison_shares_are_0():
    empty = Sums.empty(3, 5)
    assert [values.shape for values in empty] == [(5, 3, 3, 2, 2), (5, 3, 3, 2), (5, 3)]
    assert not any(values.any() for values in empty)
    assert not empty.best_weights().any()


@pytest.mark.parametrize(
    ("products", "compared", "right"),
    [
        ([[2.0, 1.4], [1.4, 1.0]], 10000.0, True),
        ([[2.0, -1.4], [-1.4, 1.0]], 0.0, True),
        ([[2.0, 1.5], [1.5, 1.0]], 3.0, False),
        ([[2.0, -1.5], [-1.5, 1.0]], 3.0, False),
        ([[2.0, 1.0], [1.01, 1.0]], 3.0, False),
        ([[2.0, 0.0], [0.0, -1.0]], 3.0, False),
        ([[-2.0, 0.0], [0.0, -1.0]], 3.0, False),
        ([[2.0, 1.43], [1.43, 1.0]], 3.0, False),
        ([[1.0, 1 + 2.5e-10], [1 + 2.5e-10, 1.0]], 3.0, True),  # rounding
        ([[1.0, 1 + 6e-10], [1 + 6e-10, 1.0]], 3.0, False),
        ([[2e6, 1.4e6], [1.4e6 + 0.0025, 1e6]], 3.0, True),
        ([[2e6, 1.4e6], [1.4e6 + 0.0031, 1e6]], 3.0, False),
        ([[2.0, 1.4], [1.4, 1.0]], 10001.0, False),
        ([[2.0, 1.4], [1.4, 1.0]], -1.0, False),
    ],
)
def test_sums_may_be_those_of_some_forecasts(products, compared, right):
    """Squares are not negative, the product of both lines is no larger than they allow, and N is bounded."""
    sums = Sums(np.array([[[np.eye(2), products]]]), np.zeros((1, 1, 2, 2)), np.array([[compared]]))
    if right:
        sums.check()
    else:
        with pytest.raises(ValueRuleError):
            sums.check()
