"""Modes with covariances: their likelihood and the regions that hold a share of them, from the equations."""

import numpy as np
import pytest

from pedpred.metrics import METRICS
from pedpred.metrics.calibration import (
    COARSE,
    FINE,
    REGIONS,
    coverage,
    mixture_nll,
    share_inside,
    share_reached,
    shown_steps,
    sunflower,
    write_component,
)
from pedpred.scenes import Predictions
from tests.by_hand.modes import PATHS, SEEN, SHARES, SIGMAS, covariances, modes_of, scene_of


def log_densities(truth, path, sigma):
    """ln N(y | mu, Sigma) of a plane Gaussian, from the inverse matrix."""
    error = truth - path
    distance2 = np.einsum("...i,...ij,...j", error, np.linalg.inv(sigma), error)
    return -distance2 / 2 - np.log(2 * np.pi * np.sqrt(np.linalg.det(sigma)))


def test_nll_of_a_mixture_is_the_mean_over_the_steps():
    """-ln sum_k w_k N(y | mu_k, Sigma_k)."""
    density = np.exp(log_densities(SEEN[:, None], PATHS, SIGMAS))
    expected = -np.log((SHARES[:, None] * density).sum(axis=1))
    given = modes_of(PATHS, SHARES, SIGMAS)
    np.testing.assert_allclose(mixture_nll(given, SEEN), expected)
    np.testing.assert_allclose(METRICS["nll"].value(given, SEEN, scene_of(2)), expected.sum(axis=1) / 3)


def test_nll_is_finite_where_densities_underflow():
    """100 deviations of 2 m from two equal modes, and 1.5 times as far from the third one."""
    path = np.array([[[[200.0, 0.0]], [[0.0, -200.0]], [[0.0, 300.0]]]])
    sigma = np.tile(4.0 * np.eye(2), (1, 3, 1, 1, 1))
    found = mixture_nll(modes_of(path, SHARES, sigma), np.zeros((1, 1, 2)))
    np.testing.assert_allclose(found, [[5000 + np.log(2 * np.pi * 4) - np.log(0.85)]], rtol=1e-12)


def test_without_covariances_there_is_no_likelihood():
    given = modes_of(PATHS, SHARES)
    np.testing.assert_array_equal(mixture_nll(given, SEEN), np.full((2, 3), np.nan))
    np.testing.assert_array_equal(METRICS["nll"].value(given, SEEN, scene_of(2)), [np.nan, np.nan])


def test_points_of_rings_lie_at_golden_angles():
    """Rings of 50, 30 and 20 %: their middles hold 25, 65 and 90 %; angles (k + 1/2) pi (3 - sqrt 5)."""
    found = sunflower(np.array([0.0, 0.5, 0.8, 1.0]))
    radius = np.sqrt([-2 * np.log(0.75), -2 * np.log(0.35), -2 * np.log(0.1)])
    angle = np.array([0.5, 1.5, 2.5]) * 2.399963229728653
    np.testing.assert_allclose(found.offset, np.stack([radius * np.cos(angle), radius * np.sin(angle)], -1))
    np.testing.assert_allclose(found.mass, [0.5, 0.3, 0.2])
    np.testing.assert_allclose(found.density, [0.75, 0.35, 0.1])


def test_fine_points_are_equal_and_coarse_ones_end_at_regions():
    assert REGIONS == (0.5, 0.9, 0.95)
    coarse = [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.58, 0.66, 0.74, 0.82, 0.9, 0.925, 0.95, 0.975, 1]
    for points, bounds in ((FINE, np.arange(65) / 64), (COARSE, np.array(coarse))):
        np.testing.assert_allclose(points.mass, np.diff(bounds))
        np.testing.assert_allclose(points.offset, sunflower(bounds).offset)
        np.testing.assert_allclose(points.density, 1 - (bounds[1:] + bounds[:-1]) / 2)


def test_region_of_one_gaussian_that_reaches_the_truth():
    """1 - exp(-d^2 / 2)."""
    given = Predictions.single(PATHS[:, 0], 0.4, SIGMAS[:, 0])
    error = SEEN - PATHS[:, 0]
    distance2 = np.einsum("...i,...ij,...j", error, np.linalg.inv(SIGMAS[:, 0]), error)
    np.testing.assert_allclose(share_inside(given, SEEN), 1 - np.exp(-distance2 / 2))


def share_denser(path, sigma, weight, truth, points):
    """Weighted share of points that are likelier than the truth; the first direction is the mean of all."""

    def density(at):
        return (weight * np.exp(log_densities(at[..., None, :], path, sigma))).sum(axis=-1)

    inside, here, centre = 0.0, density(truth), (weight[:, None] * path).sum(axis=0) / weight.sum()
    for k, share in enumerate(weight):
        root = np.linalg.cholesky(sigma[k])
        x, y = np.linalg.solve(root, centre - path[k])
        turn = np.array([[x, -y], [y, x]]) / np.hypot(x, y) if np.hypot(x, y) > 1e-9 else np.eye(2)
        at = path[k] + points.offset @ (root @ turn).T
        inside += share * points.mass[density(at) > here].sum()
    return inside


def test_region_around_a_mode_in_the_middle_of_the_others():
    """The middle mode is at the mean of all: its points keep their own directions."""
    path, weight = np.array([[[[0.0, 0.0]], [[1.0, 0.5]], [[-1.0, -0.5]]]]), np.array([0.4, 0.3, 0.3])
    sigma = covariances([0.3, 0.1, 0.5], [0.8, -0.2, 0.4], [0.4, 0.0, 0.3])[None, :, None]
    for at in ([0.3, 0.6], [0.9, -0.2], [-0.5, 0.5]):
        truth = np.array(at)
        found = share_inside(modes_of(path - truth, weight, sigma), np.zeros((1, 1, 2)))
        expected = share_denser(path[0, :, 0] - truth, sigma[0, :, 0], weight, np.zeros(2), FINE)
        np.testing.assert_allclose(found, [[expected]], atol=1e-9)


def described(path, sigma, weight):
    rows = np.empty((len(path), 9))
    for row, (x, y), own, share in zip(rows, path, sigma, weight, strict=True):
        write_component(row, x, y, own[0, 0], own[1, 0], own[1, 1], share)
    return rows


def test_weights_of_modes_need_not_sum_to_one():
    """Three modes that sum to 2: the share is their sum times that of the normalized weights."""
    path, sigma = PATHS[0, :, 1] - SEEN[0, 1], SIGMAS[0, :, 1]
    found = share_reached(described(path, sigma, 2 * SHARES), COARSE, np.zeros(0))
    np.testing.assert_allclose(found, 2 * share_denser(path, sigma, SHARES, np.zeros(2), COARSE))


@pytest.mark.parametrize("weight", [[0.65, 0.35], [0.55, 0.3, 0.15], [0.29, 0.26, 0.24, 0.21]])
def test_with_limits_shares_stay_on_their_side_of_each(weight):
    """Truths on a grid of 8 x 8 positions; the limits are a share, and two at once."""
    path, sigma = ([*values[1, :, 2], values[0, 0, 0]][: len(weight)] for values in (PATHS, SIGMAS))
    path, sigma, weight = np.array(path), np.array(sigma), np.array(weight)
    for x, y in np.ndindex(8, 8):
        truth = np.array([x - 3.0, y - 3.5])
        exact = share_denser(path, sigma, weight, truth, COARSE)
        rows = described(path - truth, sigma, weight)
        np.testing.assert_allclose(share_reached(rows, COARSE, np.zeros(0)), exact, atol=1e-9)
        for limits in map(np.array, ([0.31], [0.62], [0.5, 0.93], [0.31, 0.62, 0.97])):
            found = share_reached(rows, COARSE, limits)
            np.testing.assert_array_equal(found > limits, exact > limits)


def test_coverage_counts_truths_up_to_the_edge_of_a_region():
    inside = np.array([[0.5, 0.2, 0.95], [0.4, 0.91, 0.5], [0.6, 0.9, 0.96], [0.1, 0.51, 0.2]])
    np.testing.assert_allclose(coverage(inside, 0.5), [3 / 4, 1 / 4, 2 / 4])
    np.testing.assert_allclose(coverage(inside, 0.9), [1, 3 / 4, 2 / 4])


def test_shown_steps_are_the_first_the_middle_and_the_last():
    assert [shown_steps(steps) for steps in (10, 3, 12, 1)] == [(0, 4, 9), (0, 1, 2), (0, 5, 11), (0, 0, 0)]
