"""The tracker: optimal, causal, and steady while people stand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.errors import ConfigError, ValueRuleError
from pedpred.scenes import Recording
from pedpred.tracking import KalmanSettings, born, follow, updated
from tests.worlds import wandering

SETTINGS = KalmanSettings(acceleration_noise=0.3, position_noise_m=0.1)


def test_one_step_equals_the_textbook_matrices():
    q, r, dt = 0.3, 0.1, 0.4
    belief = updated(born(np.array([[1.0, 2.0]]), r, 1.0), np.array([dt]), np.array([[1.5, 1.8]]), q, r)
    mean, covariance = np.array([[1.0, 2.0], [0.0, 0.0]]), np.diag([r**2, 1.0])
    step = np.array([[1, dt], [0, 1]])
    noise = q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    mean, covariance = step @ mean, step @ covariance @ step.T + noise
    gain = covariance[:, :1] / (covariance[0, 0] + r**2)
    mean = mean + gain @ (np.array([[1.5, 1.8]]) - mean[:1])
    covariance = covariance - gain @ covariance[:1]
    np.testing.assert_allclose(belief.position[0], mean[0])
    np.testing.assert_allclose(belief.velocity[0], mean[1])
    np.testing.assert_allclose(belief.covariance[0], covariance[[0, 0, 1], [0, 1, 1]])


@given(st.integers(0, 2**32 - 1))
def test_a_straight_walk_is_learned_exactly_in_the_long_run(seed):
    rng = np.random.default_rng(seed)
    velocity, time_s = rng.uniform(-1.5, 1.5, 2), np.cumsum(rng.uniform(0.05, 0.5, 200))
    walk = Recording(time_s, np.zeros(200), time_s[:, None] * velocity)
    tracks = follow(walk, "kalman", SETTINGS, 0.2)
    np.testing.assert_allclose(tracks.velocity[-1], velocity, atol=1e-3)


@given(st.integers(0, 2**32 - 1))
def test_tracks_do_not_depend_on_each_other(seed):
    recording = wandering(np.random.default_rng(seed))
    both = follow(recording, "kalman", SETTINGS, 0.2)
    one = follow(recording.select(recording.track_id == 11), "kalman", SETTINGS, 0.2)
    np.testing.assert_array_equal(both.position[both.track_id == 11], one.position)
    np.testing.assert_array_equal(both.heading_rad[both.track_id == 11], one.heading_rad)


def test_heading_holds_while_standing_and_never_looks_ahead():
    time_s = np.arange(12) * 0.3
    x = np.array([0, 0, 0, 0.4, 0.8, 1.2, 1.2, 1.2, 1.2, 1.2, 1.2, 1.2])
    stand_go_stand = Recording(
        time_s,
        np.zeros(12),
        np.stack([0 * x, x], axis=-1),
        velocity=np.stack([0 * x, np.diff(x, prepend=0) / 0.3], axis=-1),
    )
    heading = follow(stand_go_stand, "truth", None, 0.2).heading_rad
    np.testing.assert_allclose(heading, [0] * 3 + [np.pi / 2] * 9)


def test_last_row_is_the_latest_detection_of_that_track():
    recording = wandering(np.random.default_rng(3))
    tracks = follow(recording, "kalman", SETTINGS, 0.2)
    rng = np.random.default_rng(4)
    track_id, time_s = rng.integers(9, 16, 300), rng.uniform(-2, 20, 300)
    for row, track, now in zip(tracks.last_row(track_id, time_s), track_id, time_s, strict=True):
        seen = np.flatnonzero((tracks.track_id == track) & (tracks.time_s <= now))
        assert row == (seen[-1] if len(seen) else -1)


def test_bad_settings_are_named():
    with pytest.raises(ValueRuleError, match="position_noise_m"):
        KalmanSettings(acceleration_noise=0.3, position_noise_m=0.0)
    with pytest.raises(ConfigError, match=r"tracker\.kind"):
        follow(wandering(np.random.default_rng(0)), "truth", None, 0.2)
