"""The tracker: noise that is tuned or learned, the cheapest pairs, and who changes whom."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import linear_sum_assignment

from pedpred import OnlinePredictor
from pedpred.errors import ValueRuleError
from pedpred.online.settings import OnlineSettings
from pedpred.scenes import Trajectories
from pedpred.tracking import KalmanBank, KalmanSettings, follow, log_likelihood, tune_kalman
from pedpred.tracking.matching import cheapest_pairs
from pedpred.tracking.noise import LEVELS
from tests.model_walks import model_walks

SETTINGS = KalmanSettings(acceleration_noise=0.3, position_noise_m=0.1)
OWN = KalmanSettings(0.0278, 0.0548, 1.05)
BANK = KalmanBank.around(OWN)
STANDSTILL_MPS = 0.2
SIDES = st.tuples(st.integers(0, 8), st.integers(0, 8))
COSTS = SIDES.flatmap(
    lambda sides: st.one_of(
        arrays(np.float64, sides, elements=st.floats(-1e6, 1e6)),
        arrays(np.float64, sides, elements=st.integers(0, 3).map(float)),  # several pairings cost the same
    )
)


def test_tuning_finds_the_noise_that_was_put_in():
    rng = np.random.default_rng(1)
    trajectories = model_walks(rng, 0.2, 0.05, rng.uniform(0.05, 0.6, (60, 60)))
    for ahead in (1, 4):
        found = tune_kalman(trajectories, ahead)
        assert found.acceleration_noise == pytest.approx(0.2, rel=0.15)
        assert found.position_noise_m == pytest.approx(0.05, rel=0.15)
        assert log_likelihood(trajectories, found, ahead) > log_likelihood(trajectories, SETTINGS, ahead)


def test_tuning_needs_somebody_who_is_detected_twice():
    with pytest.raises(ValueRuleError):
        tune_kalman(Trajectories(np.arange(3.0), np.arange(3), np.zeros((3, 2))), 8)


def test_without_detections_there_are_no_tracks():
    nobody = Trajectories(np.zeros(0), np.zeros(0), np.zeros((0, 2)))
    assert len(follow(nobody, "kalman", SETTINGS, STANDSTILL_MPS).age) == 0


@given(COSTS)
def test_the_cheapest_pairs_are_those_of_scipy(costs):
    """A robot does not have SciPy."""
    for own, theirs in zip(cheapest_pairs(costs), linear_sum_assignment(costs), strict=True):
        np.testing.assert_array_equal(own, theirs)


# Learned noise


def walkers(noise_m, seconds=24.0, people=6, interval_s=0.4, seed=0):
    """Detections, frame by frame, of people who wander about: times [T], positions [T, N, 2]."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(0.0, seconds, interval_s)
    turn = np.cumsum(rng.normal(0, 0.15 * np.sqrt(interval_s), (len(time_s), people)), axis=0)
    angle = turn + rng.uniform(-np.pi, np.pi, people)
    steps = 1.3 * interval_s * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    there = np.cumsum(steps, axis=0) + rng.uniform(-20, 20, (people, 2))
    noise_m = np.broadcast_to(noise_m, len(time_s))[:, None, None]
    return time_s, there + noise_m * rng.normal(0, 1, there.shape)


def tracked(time_s, position, bank):
    frames, people = position.shape[:2]
    rows = np.repeat(time_s, people), np.tile(np.arange(people), frames), position.reshape(-1, 2)
    return follow(Trajectories(*rows), "kalman", bank, STANDSTILL_MPS)


def test_nothing_is_learned_with_a_tracker_of_ones_own():
    for own in (OnlineSettings(tracker=OWN), OnlineSettings(learn_noise=False)):
        assert len(OnlinePredictor.load(None, own).filters.filters) == 1
    assert len(OnlinePredictor.load().filters.filters) == 1 + len(LEVELS)


def test_a_change_of_the_noise_is_followed():
    """By the filter that most people's detections fit."""
    robot, found = OnlinePredictor.load(), []
    for now, here in zip(*walkers(np.where(np.arange(120) < 60, 0.0, 0.1), seconds=48.0), strict=True):
        robot.update(float(now), np.arange(6), here)
        best = np.bincount(robot._people.filters["weight"].argmax(axis=-1)).argmax()
        found.append(BANK.filters[best].position_noise_m)
    assert [found[59], found[-1]] == [0.02, 0.1]


@pytest.mark.parametrize("bank", [BANK, KalmanBank((OWN,))])
def test_nobody_changes_the_state_of_others(bank):
    time_s, position = walkers(0.03)
    other = position + np.where(np.arange(6) < 3, 0.0, 1.0)[:, None] * np.random.default_rng(1).normal(size=2)
    other[30:, 3:] += 0.7
    one, two = (tracked(time_s, p, bank) for p in (position, other))
    same = one.track_id < 3
    for name in ("position", "velocity", "covariance", "heading_rad"):
        np.testing.assert_array_equal(getattr(one, name)[same], getattr(two, name)[same])


@pytest.mark.parametrize("noise_m", [0.0, 0.1])
def test_noisy_detections_are_smoothed_more_than_exact_ones(noise_m):
    truth = walkers(0.0, seconds=60.0, people=12)[1]
    velocity, misses = np.diff(truth, axis=0) / 0.4, []
    for bank in (KalmanBank((OWN,)), BANK):
        found = tracked(*walkers(noise_m, seconds=60.0, people=12), bank).velocity
        found = found.reshape(12, -1, 2).swapaxes(0, 1)[1:]
        misses.append(np.linalg.norm(found - velocity, axis=-1)[20:].mean())
    assert misses[1] < 0.95 * misses[0]


@settings(max_examples=5, deadline=None)
@given(st.sampled_from([0.0, 0.03, 0.1]), st.sampled_from([0.04, 0.1, 0.4]), st.integers(0, 99))
def test_a_robot_tracks_as_a_recording_is_tracked(noise_m, interval_s, seed):
    time_s, position = walkers(noise_m, 40 * interval_s, 3, interval_s, seed)
    robot = OnlinePredictor.load()
    about = robot.description
    tracks = follow(
        Trajectories(np.repeat(time_s, 3), np.tile(np.arange(3), len(time_s)), position.reshape(-1, 2)),
        "kalman",
        robot.filters,
        about.standstill_mps,
    )
    for k, (now, here) in enumerate(zip(time_s, position, strict=True)):
        robot.update(float(now), np.arange(3), here)
        rows = len(time_s) * np.arange(3) + k
        for name in ("detection", "position", "velocity", "covariance", "heading_rad"):
            np.testing.assert_array_equal(getattr(robot._people, name), getattr(tracks, name)[rows], name)
