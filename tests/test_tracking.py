"""The tracker is optimal and causal, and holds the heading of standing people."""

import numpy as np
import pytest

from pedpred.errors import ValueRuleError
from pedpred.scenes import Trajectories
from pedpred.simulation.sensor import SensorSettings, apply_sensor
from pedpred.tracking import (
    KalmanSettings,
    follow,
    log_likelihood,
    tune_kalman,
)
from pedpred.tracking.tuning import LEAST
from tests.model_walks import model_walks
from tests.worlds import walled_scene, wandering

SETTINGS = KalmanSettings(acceleration_noise=0.3, position_noise_m=0.1)


def test_the_filter_knows_how_wrong_it_is():
    """Detections of the filter's own model: innovations are as large as it says, at any irregular rate."""
    rng = np.random.default_rng(0)
    walks = model_walks(rng, 0.2, 0.05, irregular(rng))
    tracks = follow(walks, "kalman", KalmanSettings(0.2, 0.05), 0.2)
    row = np.flatnonzero(tracks.age >= 5)
    before = tracks.belief_at(row - 1, tracks.time_s[row], 0.2)
    miss = (tracks.detection[row] - before.position) ** 2 / (before.covariance[:, :1] + 0.05**2)
    assert miss.mean() == pytest.approx(1.0, abs=0.05)


def test_tuning_finds_the_noise_that_was_put_in():
    rng = np.random.default_rng(1)
    trajectories = model_walks(rng, 0.2, 0.05, irregular(rng))
    for ahead in (1, 4):
        found = tune_kalman(trajectories, ahead)
        assert found.acceleration_noise == pytest.approx(0.2, rel=0.15)
        assert found.position_noise_m == pytest.approx(0.05, rel=0.15)
        assert log_likelihood(trajectories, found, ahead) > log_likelihood(trajectories, SETTINGS, ahead)


@pytest.mark.parametrize(("speed_mps", "turn_radps"), [(0.0, 0.0), (1.0, 0.0), (1.0, 0.5)])
def test_tuning_ends_where_there_is_no_noise(speed_mps, turn_radps):
    time_s, track_id = np.tile(np.arange(20) * 0.4, 5), np.repeat(np.arange(5), 20)
    angle = turn_radps * time_s + track_id
    along = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    trajectories = Trajectories(time_s, track_id, speed_mps * time_s[:, None] * along)
    for ahead in (1, 8):
        assert tune_kalman(trajectories, ahead).position_noise_m == LEAST


def test_tuning_needs_somebody_who_is_detected_twice():
    with pytest.raises(ValueRuleError):
        tune_kalman(Trajectories(np.arange(3.0), np.arange(3), np.zeros((3, 2))), 8)


def irregular(rng):
    return rng.uniform(0.05, 0.6, (60, 60))


def test_detections_in_any_order_give_the_same_tracks():
    """Time running backwards in a file is no error: stamps say when, rows do not."""
    trajectories = wandering(np.random.default_rng(0))
    shuffled = trajectories.select(np.random.default_rng(1).permutation(len(trajectories)))
    a, b = (follow(r, "kalman", SETTINGS, 0.2) for r in (trajectories, shuffled))
    np.testing.assert_array_equal(a.position, b.position)


def test_without_detections_there_are_no_tracks():
    nobody = Trajectories(np.zeros(0), np.zeros(0), np.zeros((0, 2)))
    assert len(follow(nobody, "kalman", SETTINGS, 0.2).age) == 0


# Sensors and protocols


def test_a_slow_sensor_sees_every_third_instant():
    scene = walled_scene(np.random.default_rng(0))
    seen = apply_sensor(scene, SensorSettings(rate_hz=0.8), np.random.default_rng(1))
    times, every = (np.unique(s.trajectories.time_s) for s in (seen, scene))
    np.testing.assert_array_equal(times, every[::3])
    assert seen.detection_dt_s == pytest.approx(1.2)
