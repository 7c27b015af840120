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
    """Log weights of the robot's filters after each frame. [T, N, H]."""
    weights = []
    for now, here in zip(time_s, position, strict=True):
        robot.update(float(now), np.arange(len(here)), here)
        weights.append(robot._people.filters["weight"])
    return np.array(weights)


def levels_m(weights):
    """Noise of the filter that most people's detections fit, m."""
    return BANK.filters[np.bincount(weights.argmax(axis=-1)).argmax()].position_noise_m


def test_nothing_is_learned_with_a_tracker_of_ones_own():
    for own in (OnlineSettings(tracker=OWN), OnlineSettings(learn_noise=False)):
        assert len(OnlinePredictor.load(None, own).filters.filters) == 1
    assert len(OnlinePredictor.load().filters.filters) == 1 + len(LEVELS)


@settings(max_examples=5)
@given(st.sampled_from([0.0, 0.03, 0.1]), st.sampled_from([0.04, 0.1, 0.4]), st.integers(0, 99))
def test_a_robot_tracks_as_a_recording_is_tracked(noise_m, interval_s, seed):
    time_s, position = walkers(noise_m, interval_s, 40 * interval_s, 3, seed)
    robot = OnlinePredictor.load()
    about = robot.description
    tracks = follow(trajectories(time_s, position), "kalman", robot.filters, about.standstill_mps)
    for k, (now, here) in enumerate(zip(time_s, position, strict=True)):
        robot.update(float(now), np.arange(3), here)
        rows = len(time_s) * np.arange(3) + k
        for name in ("detection", "position", "velocity", "covariance", "heading_rad"):
            np.testing.assert_array_equal(getattr(robot._people, name), getattr(tracks, name)[rows], name)


def test_a_change_of_the_noise_is_followed():
    noise_m = np.where(np.arange(120) < 60, 0.0, 0.1)
    weights = seen_by(OnlinePredictor.load(), *walkers(noise_m, seconds=48.0))
    assert [levels_m(weights[k]) for k in (59, -1)] == [0.02, 0.1]


@pytest.mark.parametrize("bank", [BANK, KalmanBank((OWN,))])
def test_nobody_changes_the_state_of_others(bank):
    time_s, position = walkers(0.03)
    other = position + np.where(np.arange(6) < 3, 0.0, 1.0)[:, None] * np.random.default_rng(1).normal(size=2)
    other[30:, 3:] += 0.7
    one, two = (follow(trajectories(time_s, p), "kalman", bank, STANDSTILL_MPS) for p in (position, other))
    same = one.track_id < 3
    for name in ("position", "velocity", "covariance", "heading_rad"):
        np.testing.assert_array_equal(getattr(one, name)[same], getattr(two, name)[same])


def test_who_stands_teaches_nothing():
    position = np.tile(np.arange(6.0)[:, None] * [1.0, 2.0], (60, 1, 1))
    weights = seen_by(OnlinePredictor.load(), np.arange(60) * 0.1, position)
    np.testing.assert_array_equal(weights[-1], BANK.initial_weights(6))


def test_noisy_detections_are_smoothed_more_than_exact_ones():
    for noise_m in (0.0, 0.1):
        time_s, truth = walkers(0.0, seconds=60.0, people=12)
        position = walkers(noise_m, seconds=60.0, people=12)[1]
        velocity = np.diff(truth, axis=0) / 0.4
        misses = []
        for bank in (KalmanBank((OWN,)), BANK):
            tracks = follow(trajectories(time_s, position), "kalman", bank, STANDSTILL_MPS)
            tracked = tracks.velocity.reshape(12, -1, 2).swapaxes(0, 1)[1:]
            misses.append(np.linalg.norm(tracked - velocity, axis=-1)[20:].mean())
        assert misses[1] < 0.95 * misses[0], noise_m
