"""Paths that cover a forecast: evenly spread draws and k-means with distances, by hand."""

import numpy as np

from pedpred.metrics.covering import covering_paths, even_draws
from tests.by_hand.modes import PATHS, SHARES, SIGMAS, modes_of


def test_draws_are_spread_by_an_additive_recurrence():
    """Draw n is the fraction of 0.5 + n / r^k, k = 1, 2, 3, with r^4 = r + 1 (Roberts 2018).

    The first of the three chooses the mode; the others are a pair of normal numbers (Box & Muller 1958).
    """
    r = np.roots([1, 0, 0, -1, -1]).real.max()
    first, second, third = ((0.5 + np.arange(1, 8) / r**k) % 1 for k in (1, 2, 3))
    share, noise = even_draws(7)
    np.testing.assert_allclose(share, first)
    away = np.sqrt(-2 * np.log(1 - second))
    np.testing.assert_allclose(noise[:, 0], away * np.cos(2 * np.pi * third))
    np.testing.assert_allclose(noise[:, 1], away * np.sin(2 * np.pi * third))


def test_twelve_rounds_of_means_of_the_nearest_draws():
    """From every so many-th of 384 draws; the distance of two paths is the sum of those of their steps."""
    given, count = modes_of(PATHS[:, :, :2], SHARES, SIGMAS[:, :, :2]), 5
    share, noise = even_draws(384)
    mode = (share[:, None] >= [0.55, 0.85]).sum(axis=1)
    root = np.linalg.cholesky(given.covariance[:, mode])
    draws = given.path[:, mode] + np.einsum("wdpij,dj->wdpi", root, noise)
    expected = draws[:, [0, 76, 153, 230, 307]]
    for _ in range(12):
        away = np.linalg.norm(draws[:, :, None] - expected[:, None], axis=-1).sum(axis=-1)
        nearest = away.argmin(axis=2)
        expected = np.array([
            [own[near == c].mean(axis=0) for c in range(count)]
            for own, near in zip(draws, nearest, strict=True)
        ])  # fmt: skip
    np.testing.assert_allclose(covering_paths(given, count), expected, rtol=1e-9)


def apart(variance_m2):
    """Two equally likely modes of two steps that are far apart, in two windows alike. [2, 2, 2, 2]."""
    path = np.array([[[100.0, -80.0], [90.0, -70.0]], [[-100.0, 80.0], [-90.0, 75.0]]])
    sigma = np.broadcast_to(variance_m2 * np.eye(2), (2, 2, 2, 2, 2))
    return path, modes_of(np.stack([path, path]), [0.5, 0.5], sigma)


def test_a_path_to_which_no_draw_is_nearest_stays():
    """Without spread, draws are modes: 0, 96, 192 and 288 have shares of 0.32, 0.96, 0.60 and 0.24."""
    path, given = apart(1e-36)
    np.testing.assert_array_equal(covering_paths(given, 4), [path[[0, 1, 1, 0]]] * 2)


def test_each_window_begins_anew():
    """Two paths are at once the means of the draws of either mode, in the second window as in the first."""
    path, given = apart(0.25)
    share, noise = even_draws(384)
    moved = [0.5 * noise[share < 0.5].mean(axis=0), 0.5 * noise[share >= 0.5].mean(axis=0)]
    np.testing.assert_allclose(covering_paths(given, 2), [path + np.array(moved)[:, None]] * 2)
