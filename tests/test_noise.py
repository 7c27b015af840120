"""The tracker learns how noisy a stream's detections are, the same on a robot as in a recording."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred import OnlinePredictor
from pedpred.online.settings import OnlineSettings
from pedpred.scenes import Trajectories
from pedpred.tracking import KalmanBank, KalmanSettings, follow
from pedpred.tracking.noise import LEVELS

OWN = KalmanSettings(0.0278, 0.0548, 1.05)
BANK = KalmanBank.around(OWN)
STANDSTILL_MPS = 0.2
LEARNS = OnlineSettings(learn_noise=True)


def walkers(noise_m, interval_s=0.4, seconds=24.0, people=6, seed=0):
    """Detections, frame by frame, of people who wander about: times [T], positions [T, N, 2]."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(0.0, seconds, interval_s)
    turn = np.cumsum(rng.normal(0, 0.15 * np.sqrt(interval_s), (len(time_s), people)), axis=0)
    angle = turn + rng.uniform(-np.pi, np.pi, people)
    steps = 1.3 * interval_s * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    there = np.cumsum(steps, axis=0) + rng.uniform(-20, 20, (people, 2))
    return time_s, there + rng.normal(0, 1, there.shape) * np.broadcast_to(noise_m, len(time_s))[
        :, None, None
    ]


def trajectories(time_s, position):
    frames, people = position.shape[:2]
    return Trajectories(
        np.repeat(time_s, people), np.tile(np.arange(people), frames), position.reshape(-1, 2)
    )


def seen_by(robot, time_s, position):
    """The robot's filter that is used after each frame."""
    used = []
    for now, here in zip(time_s, position, strict=True):
        robot.update(float(now), np.arange(len(here)), here)
        used.append(robot._weights.argmax())
    return np.array(used)


@pytest.mark.parametrize(("noise_m", "expected_m"), [(0.0, 0.02), (0.02, 0.02), (0.06, 0.0548), (0.1, 0.1)])
def test_the_level_that_fits_is_used(noise_m, expected_m):
    used = seen_by(OnlinePredictor.load(None, LEARNS), *walkers(noise_m))
    assert BANK.filters[used[-1]].position_noise_m == expected_m


def test_nothing_is_learned_where_a_tracker_is_ownor_learning_is_off():
    for own in (OnlineSettings(tracker=OWN, learn_noise=True), OnlineSettings()):
        assert len(OnlinePredictor.load(None, own).filters.filters) == 1
    assert len(OnlinePredictor.load(None, LEARNS).filters.filters) == 1 + len(LEVELS)


@settings(max_examples=8)
@given(st.sampled_from([0.0, 0.03, 0.1]), st.sampled_from([0.04, 0.1, 0.4]), st.integers(0, 99))
def test_a_robot_tracks_as_a_recording_is_tracked(noise_m, interval_s, seed):
    time_s, position = walkers(noise_m, interval_s, 40 * interval_s, 3, seed)
    robot = OnlinePredictor.load(None, LEARNS)
    about = robot.description
    tracks = follow(trajectories(time_s, position), "kalman", robot.filters, about.standstill_mps)
    for k, (now, here) in enumerate(zip(time_s, position, strict=True)):
        robot.update(float(now), np.arange(3), here)
        rows = len(time_s) * np.arange(3) + k
        for name in ("position", "velocity", "covariance", "heading_rad"):
            np.testing.assert_array_equal(getattr(robot._people, name), getattr(tracks, name)[rows], name)


def test_one_filter_is_the_filter_itself():
    seen = trajectories(*walkers(0.03))
    alone, bank = (follow(seen, "kalman", kalman, STANDSTILL_MPS) for kalman in (OWN, KalmanBank((OWN,))))
    for name, values in vars(alone).items():
        np.testing.assert_array_equal(values, getattr(bank, name))


def test_the_future_changes_nothing():
    time_s, position = walkers(np.where(np.arange(60) < 30, 0.0, 0.1))
    whole = follow(trajectories(time_s, position), "kalman", BANK, STANDSTILL_MPS)
    half = follow(trajectories(time_s[:30], position[:30]), "kalman", BANK, STANDSTILL_MPS)
    np.testing.assert_array_equal(whole.velocity[whole.time_s < time_s[30]], half.velocity)


def test_a_stream_whose_noise_changes_is_followed():
    noise_m = np.where(np.arange(240) < 120, 0.0, 0.1)
    used = seen_by(OnlinePredictor.load(None, LEARNS), *walkers(noise_m, seconds=96.0))
    assert [BANK.filters[k].position_noise_m for k in (used[119], used[-1])] == [0.02, 0.1]


def test_furniture_teaches_nothing():
    time_s, position = walkers(0.1)
    things = np.tile(np.stack([np.full(20, 60.0), 2.0 * np.arange(20)], axis=1), (len(time_s), 1, 1))
    with_things = np.concatenate([position, things], axis=1)
    few, many = OnlinePredictor.load(None, LEARNS), OnlinePredictor.load(None, LEARNS)
    np.testing.assert_array_equal(seen_by(few, time_s, position), seen_by(many, time_s, with_things))
    np.testing.assert_allclose(few._weights, many._weights)


def test_exact_detections_are_followed_closer_and_noisy_ones_smoothed_more():
    for noise_m in (0.0, 0.1):
        time_s, truth = walkers(0.0, seconds=60.0, people=12)
        position = walkers(noise_m, seconds=60.0, people=12)[1]
        velocity = np.diff(truth, axis=0) / 0.4
        misses = []
        for bank in (KalmanBank((OWN,)), BANK):
            tracks = follow(trajectories(time_s, position), "kalman", bank, STANDSTILL_MPS)
            tracked = tracks.velocity.reshape(12, -1, 2).swapaxes(0, 1)[1:]
            misses.append(np.linalg.norm(tracked - velocity, axis=-1)[20:].mean())
        assert misses[1] < 0.9 * misses[0], noise_m


def test_learning_ends_with_a_reset_and_not_with_a_jump_of_the_clock():
    robot = OnlinePredictor.load(None, LEARNS)
    seen_by(robot, *walkers(0.1))
    learned = robot._weights
    robot.update(1e6, [1], [[0.0, 0.0]])
    np.testing.assert_array_equal(robot._weights, learned)
    robot.reset()
    np.testing.assert_array_equal(robot._weights, BANK.unlearned())
