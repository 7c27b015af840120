"""Modes that are merged: what stays of a forecast, and what does not matter."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.forecasting.reduction import merge_modes
from pedpred.scenes import Predictions

STEPS, DT_S = 5, 0.3
SEEDS = st.integers(0, 2**32 - 1)


def predictions(path, weight, covariance):
    order = np.argsort(-weight, axis=1, kind="stable")
    at = np.arange(len(weight))[:, None], order
    return Predictions(path[:, 0], path[at], weight[at], DT_S, covariance[at])


def modes(rng, people=6, count=12):
    """Random modes with random covariances; half of them mirror images of the others."""
    half = count // 2
    path = np.cumsum(rng.normal(0, 0.5, (people, half, STEPS, 2)), axis=2)
    root = rng.normal(0, 0.3, (people, half, STEPS, 2, 2)) + 0.2 * np.eye(2)
    weight = rng.dirichlet(np.ones(half), people) + 1e-3
    return path, weight / weight.sum(axis=1, keepdims=True), root @ np.swapaxes(root, -1, -2)


def moments(given):
    """Mean and covariance of the positions over all modes."""
    mean, away = given.mean, given.path - given.mean[:, None]
    each = given.covariance + away[..., None] * away[..., None, :]
    return mean, (given.weight[..., None, None, None] * each).sum(axis=1)


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS, most=st.integers(1, 12))
def test_mean_and_covariance_of_the_positions_stay(seed, most):
    before = predictions(*modes(np.random.default_rng(seed)))
    after = merge_modes(before, most)
    assert after.modes == min(most, before.modes)
    for one, other in zip(moments(before), moments(after), strict=True):
        np.testing.assert_allclose(other, one, atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS, most=st.integers(2, 8))
def test_a_symmetric_forecast_stays_symmetric(seed, most):
    """Also if equal merges would leave too few modes, and in spite of rounding."""
    rng = np.random.default_rng(seed)
    path, weight, covariance = modes(rng)
    side = np.array([1.0, -1.0])
    path = np.concatenate([path, path * side], axis=1) + rng.normal(0, 1e-9, (1, 1, 1, 2))
    covariance = np.concatenate([covariance, covariance * np.outer(side, side)], axis=1)
    after = merge_modes(predictions(path, np.tile(0.5 * weight, 2), covariance), most)
    gap = np.linalg.norm(after.path[:, :, None] - (after.path * side)[:, None], axis=-1).max(axis=-1)
    assert gap.min(axis=2).max() < 1e-6
