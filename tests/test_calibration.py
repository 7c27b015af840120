"""Covariances of forecasts: what they promise, by hand and by drawing from them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.baselines.present_motion import kalman_covariance
from pedpred.geometry import rotate, rotated_covariance
from pedpred.metrics.calibration import (
    COARSE,
    FINE,
    REGIONS,
    coverage,
    negative_log_likelihood,
    share_inside,
    squared_mahalanobis,
)
from pedpred.scenes import Predictions
from pedpred.tracking import KalmanSettings, follow
from tests.model_walks import model_walks

TRACKER = KalmanSettings(acceleration_noise=0.02, position_noise_m=0.05)


def some_covariance(rng, rows):
    root = rng.normal(size=(rows, 2, 2))
    return root @ np.swapaxes(root, -1, -2) + 0.01 * np.eye(2)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.floats(-7.0, 7.0))
def test_turning_the_world_changes_neither_distance_nor_surprise(seed, angle):
    rng = np.random.default_rng(seed)
    covariance, error = some_covariance(rng, 5), rng.normal(size=(5, 2))
    turned = rotated_covariance(covariance, np.full(5, angle))
    before = squared_mahalanobis(error, covariance)
    after = squared_mahalanobis(rotate(error, np.full(5, angle)), turned)
    np.testing.assert_allclose(after, before, rtol=1e-6)
    nll = [negative_log_likelihood(before, sigma) for sigma in (covariance, turned)]
    np.testing.assert_allclose(*nll, rtol=1e-6, atol=1e-9)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.floats(-7.0, 7.0))
def test_turning_the_world_changes_no_region_of_several_modes(seed, angle):
    rng = np.random.default_rng(seed)
    forecast, truth = some_modes(rng, 20, np.array([0.5, 0.3, 0.2])), rng.normal(size=(20, 1, 2))
    turn = np.full((20, 3, 1), angle)
    turned = Predictions(
        rotate(forecast.point, turn[:, 0]), rotate(forecast.path, turn), forecast.weight, 0.3,
        rotated_covariance(forecast.covariance, np.full(20, angle)),
    )  # fmt: skip
    for points in (COARSE, FINE):
        before = share_inside(forecast, truth, points)
        after = share_inside(turned, rotate(truth, turn[:, 0]), points)
        assert (
            np.mean(np.abs(after - before) < 1e-9) > 0.98
        )  # but where a point is exactly as likely as the truth


def some_modes(rng, rows, weight):
    """Predictions of one step; the modes overlap here and there."""
    path = rng.normal(size=(rows, len(weight), 1, 2))
    covariance = 0.2 * some_covariance(rng, rows * len(weight)).reshape(rows, len(weight), 1, 2, 2)
    return Predictions(path.mean(axis=1), path, np.tile(weight, (rows, 1)), 0.3, covariance)


def test_what_is_drawn_from_several_modes_lies_in_their_regions():
    rng, weight = np.random.default_rng(0), np.array([0.6, 0.3, 0.1])
    forecast = some_modes(rng, 6000, weight)
    mode = rng.choice(3, 6000, p=weight)
    centre, covariance = (own[np.arange(6000), mode] for own in (forecast.path, forecast.covariance))
    truth = centre + (np.linalg.cholesky(covariance) @ rng.normal(size=(6000, 1, 2, 1)))[..., 0]
    inside = share_inside(forecast, truth)
    for share in REGIONS:
        assert coverage(inside, share) == pytest.approx(share, abs=0.02)


def test_one_mode_written_as_several_has_the_same_regions():
    rng = np.random.default_rng(1)
    one = some_modes(rng, 200, np.array([1.0]))
    copies = [np.repeat(own, 4, axis=1) for own in (one.path, one.covariance)]
    four = Predictions(one.point, copies[0], np.full((200, 4), 0.25), 0.3, copies[1])
    truth = one.path[:, 0] + rng.normal(size=(200, 1, 2))
    np.testing.assert_allclose(share_inside(four, truth), share_inside(one, truth), atol=0.2)
    assert np.abs(share_inside(four, truth) - share_inside(one, truth)).mean() < 0.05


def test_covariances_of_the_tracker_hold_in_its_own_model():
    rng, dt_s, known, ahead = np.random.default_rng(1), 0.4, 6, 5
    q, r = TRACKER.acceleration_noise, TRACKER.position_noise_m
    walks = model_walks(rng, q, r, np.full((4000, known + ahead), dt_s))
    tracks = follow(walks.select(walks.time_s < (known + 0.5) * dt_s), "kalman", TRACKER, 0.2)
    last = tracks.age == known - 1
    forecast = tracks.position[last] + ahead * dt_s * tracks.velocity[last]
    covariance = kalman_covariance(TRACKER, dt_s, np.array([ahead * dt_s]))
    forecast = Predictions.single(forecast[:, None], dt_s, np.broadcast_to(covariance, (4000, 1, 2, 2)))
    inside = share_inside(forecast, walks.position[-4000:, None])
    for share in REGIONS:
        assert coverage(inside, share) == pytest.approx(share, abs=0.03)
