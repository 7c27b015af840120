"""Sensor, tracker and protocol of a scene: what is tracked, beside the parts by hand."""

import zlib
from dataclasses import replace

import numpy as np
import pytest

from pedpred.errors import ValueRuleError
from pedpred.features import ForecastProtocol, Pedestrians
from pedpred.features.perception import Perception, fitted, parse_tracker, perceived, sensed
from pedpred.scenes import Scene, Trajectories
from pedpred.simulation.sensor import SensorSettings, apply_sensor
from pedpred.tracking import KalmanSettings, follow, resampled, tune_kalman
from tests.by_hand.lives import PACE, SEEN, TIME_S, TRACK, scene_of
from tests.model_walks import model_walks
from tests.worlds import empty_map


def test_a_sensor_draws_its_faults_by_seed_and_name():
    scene, sensor = scene_of(), SensorSettings(position_noise_m=0.1, seed=3)
    expected = apply_sensor(scene, sensor, np.random.default_rng([3, zlib.crc32(b"hand")]))
    seen = sensed(scene, sensor).trajectories
    np.testing.assert_array_equal(seen.position, expected.trajectories.position)
    assert (sensed(replace(scene, name="other"), sensor).trajectories.position != seen.position).any()
    assert sensed(scene, SensorSettings()) is scene


def test_people_are_tracked_as_they_are_perceived():
    """By filters, by their true states, or resampled without a sensor where the protocol is noncausal."""
    truth = Trajectories(TIME_S, TRACK, SEEN, PACE)
    scene, filters = Scene("hand", truth, empty_map(), 0.4), KalmanSettings(0.3, 0.1)
    sensor, sizes = SensorSettings(position_noise_m=0.2), ForecastProtocol(lost_after_s=0.45)
    seen, tracks = perceived(scene, Perception(filters, 0.4, sensor), sizes)
    np.testing.assert_array_equal(seen.trajectories.position, sensed(scene, sensor).trajectories.position)
    expected = follow(seen.trajectories, "kalman", filters, 0.4, 0.45)
    np.testing.assert_array_equal(tracks.velocity, expected.velocity)
    assert tracks.life.tolist() == expected.life.tolist() == [0, 0, 0, 1, 2, 2, 3, 3]
    by_truth = perceived(scene, Perception(None, 0.95), ForecastProtocol())[1]
    np.testing.assert_array_equal(by_truth.velocity[:6], PACE[:6])
    assert by_truth.heading_rad[1] == pytest.approx(np.arctan2(0.4, 0.9))
    assert by_truth.heading_rad[3] == pytest.approx(np.arctan2(1.0, 0.8))
    how, leaky = Perception(filters, 0.2, sensor), ForecastProtocol(0.4, noncausal=True, lost_after_s=0.45)
    seen, tracks = perceived(scene, how, leaky)
    expected = resampled(scene, 0.4, 0.45)
    np.testing.assert_array_equal(seen.trajectories.position, expected.trajectories.position)
    np.testing.assert_array_equal(np.sort(tracks.velocity, 0), np.sort(expected.trajectories.velocity, 0))
    assert seen.detection_dt_s == 0.4


SIZES = ForecastProtocol()
PLAIN = {"kind": "kalman", "acceleration_noise": 0.3, "position_noise_m": 0.1, "initial_speed_mps": 1.4}


def test_a_tracker_is_a_filter_or_the_truth():
    assert parse_tracker(PLAIN) == KalmanSettings(0.3, 0.1, 1.4)
    assert parse_tracker({"kind": "truth"}) is None
    wrong = [[PLAIN], {"kind": "other"}, {**PLAIN, "kind": "other"}]
    wrong += [{**PLAIN, "position_noise_m": value} for value in (0.0, float("inf"), "0.1")]
    wrong += [{"kind": "truth", "position_noise_m": 0.1}]
    for plain in wrong:
        with pytest.raises(ValueRuleError):
            parse_tracker(plain)


def test_states_of_people_are_in_double_precision():
    one = np.ones((1, 2), np.float32)
    people = Pedestrians(np.array([3]), one, np.zeros(1, int), one)
    assert [v.dtype for v in (people.position, people.heading_rad, people.velocity)] == [np.float64] * 3


def test_a_tracker_is_fitted_to_what_the_sensor_gives():
    """Over 1.2 s, three detections, or one at least; true states and resampled tracks need no tracker."""
    rng = np.random.default_rng(1)
    walks = model_walks(rng, 0.2, 0.01, np.full((40, 30), 0.4))
    scene, sizes = Scene("hand", walks, empty_map(), 0.4), ForecastProtocol(0.3, 4)
    how = Perception(KalmanSettings(3.0, 1.0), 0.3, SensorSettings(position_noise_m=0.1))
    seen = sensed(scene, how.sensor).trajectories
    for horizon, ahead in ((sizes, 3), (ForecastProtocol(0.1, 1), 1)):
        assert fitted(scene, how, horizon) == replace(how, kalman=tune_kalman(seen, ahead, 0.01))
    assert fitted(scene, how, sizes).kalman.position_noise_m == pytest.approx(0.1, rel=0.15)
    for true, other in ((replace(how, kalman=None), sizes), (how, replace(sizes, noncausal=True))):
        assert fitted(scene, true, other) is true


def test_a_tracker_is_fitted_to_every_so_many_people():
    """45 000 detections: of the people 0, 3, 6, ..., who alone have noise."""
    rng = np.random.default_rng(2)
    noisy, exact = (model_walks(rng, 0.2, noise_m, np.full((300, 50), 0.4)) for noise_m in (0.2, 0.01))
    people = Trajectories(
        np.concatenate([noisy.time_s, exact.time_s, exact.time_s]),
        np.concatenate([3 * noisy.track_id, 3 * exact.track_id + 1, 3 * exact.track_id + 2]),
        np.concatenate([noisy.position, exact.position, exact.position]),
    )
    found = fitted(Scene("hand", people, empty_map(), 0.4), Perception(KalmanSettings(1, 1), 0.3), SIZES)
    assert found.kalman.position_noise_m == pytest.approx(0.2, rel=0.1)
