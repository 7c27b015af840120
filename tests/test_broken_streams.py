"""Streams with jumps, bursts, other clocks and furniture: other people are forecast as before."""

import copy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.geometry import rotate
from pedpred.metrics.calibration import share_inside
from pedpred.online import OnlinePredictor
from pedpred.scenes import OccupancyMap
from pedpred.scenes.occupancy import FARTHEST_M

SEEDS = st.integers(0, 2**32 - 1)
JUMPER, NOBODY = 7, 1000


def walkers(rng, people, apart_m=0.0):
    """Start and velocity of people; `apart_m` more between the jumper and the others."""
    start, velocity = rng.uniform(-9, 9, (people, 2)), rng.normal(0, 0.8, (people, 2))
    start[JUMPER] += apart_m
    return start, velocity


def assert_sound(forecast, track_id):
    """Everybody has a forecast that a planner can use."""
    predictions = forecast.predictions
    np.testing.assert_array_equal(forecast.track_id, track_id)
    assert np.isfinite(predictions.path).all()
    assert np.isfinite(predictions.point).all()
    np.testing.assert_allclose(predictions.weight.sum(axis=1), 1.0, atol=1e-9)
    assert (np.linalg.eigvalsh(predictions.covariance) > 0).all()


def test_an_id_that_jumps_is_a_new_person(model):
    """All forecasts are those of a stream in which the person leaves and another one appears."""
    rng = np.random.default_rng(1)
    start, velocity = walkers(rng, people=8, apart_m=100.0)
    robot, other = OnlinePredictor.load(model[0]), OnlinePredictor.load(model[0])
    for k in range(25):
        position = start + 0.1 * k * velocity + rng.normal(0, 0.02, start.shape)
        ids, renamed = np.arange(8), np.arange(8)
        if k >= 15:
            position[JUMPER] += 12.0
            renamed[JUMPER] = NOBODY
        found, expected = robot.update(0.1 * k, ids, position), other.update(0.1 * k, renamed, position)
        rows = [*range(JUMPER), -1]  # in between, for half a second, is the person who left
        np.testing.assert_allclose(found.predictions.path, expected.predictions.path[rows], atol=1e-6)
        np.testing.assert_allclose(found.covariance, expected.covariance[rows], atol=1e-6)
        assert_sound(found, ids)


@pytest.mark.parametrize("kind", ["model", "default"])
@settings(max_examples=5)
@given(
    seed=SEEDS,
    jumps=st.lists(st.floats(0, np.log10(FARTHEST_M) - 0.1), min_size=1, max_size=3),
    gaps=st.lists(st.floats(-6, 1), min_size=4, max_size=8),
)
def test_no_jump_and_no_gap_spoils_a_forecast(kind, model, seed, jumps, gaps):
    """Jumps of 1 m to 1e8 m, frames 1 us to 10 s apart: all people have forecasts, the others the same."""
    rng, folder = np.random.default_rng(seed), model[0] if kind == "model" else None
    start, velocity = walkers(rng, people=8)
    robot, other, now = OnlinePredictor.load(folder), OnlinePredictor.load(folder), 0.0
    others = np.delete(np.arange(len(start)), JUMPER)
    for k in range(22):
        now += 10.0 ** gaps[k % len(gaps)] if k >= 10 else 0.1
        position = np.clip(start + now * velocity, -50, 50) + rng.normal(0, 0.05, start.shape)
        position[JUMPER] += 300.0  # far from the others, on whom it would have an influence
        robot_sees = position.copy()
        if k >= 10 and k % 3 == 0:
            robot_sees[JUMPER] += 10.0 ** jumps[k % len(jumps)] * np.array([0.6, -0.8])
        found = robot.update(now, np.arange(len(start)), robot_sees)
        expected = other.update(now, np.arange(len(start)), position)
        assert_sound(found, np.arange(len(start)))
        np.testing.assert_array_equal(found.predictions.path[others], expected.predictions.path[others])


# Rates and bursts

WARM_S = 4.0


def mean_error_m(instants, people=30):
    """Mean error after `WARM_S` of forecasts of people who walk straight and are seen at some instants, m."""
    rng, robot, errors = np.random.default_rng(0), OnlinePredictor.load(), []
    start = np.stack([np.zeros(people), 60.0 * np.arange(people)], axis=1)
    velocity = np.array([1.3, 0.0])
    for now in np.sort(np.ravel(instants)):
        seen = start + now * velocity + rng.normal(0, 0.03, (people, 2))
        forecast = robot.update(float(now), np.arange(people), seen)
        if now > WARM_S:
            truth = start[:, None] + velocity * (now + 0.3 * np.arange(1, 11))[:, None]
            errors.append(np.linalg.norm(forecast.position - truth, axis=-1).mean())
    return np.mean(errors)


def test_fast_frames_are_no_noisier():
    """At 30 Hz, and three frames 2 us apart, of people who were first seen 2.5 s before."""
    slow = np.arange(1.5, WARM_S + 2.0, 0.1)
    usual_m = mean_error_m(slow)
    for fast in (np.arange(1.5, WARM_S + 1.0, 1 / 30), np.add.outer(slow, [0.0, 2e-6, 4e-6])):
        assert mean_error_m(fast) < 1.3 * usual_m


# What is learned


def test_a_clock_that_changes_without_people_costs_nothing():
    """Regions learn, and nothing is kept for ever."""
    rng = np.random.default_rng(3)
    other, *robots = (OnlinePredictor.load() for _ in range(3))
    for robot, odd_s in zip(robots, (1e9, -5.0), strict=True):
        robot.update(odd_s, [], [])
    for k in range(70):
        position = np.array([[0.12 * k, 0.0], [5.0 - 0.12 * k, 1.0]]) + rng.normal(0, 0.03, (2, 2))
        expected, *found = (robot.update(0.1 * k, [1, 2], position) for robot in (other, *robots))
        for one in found:
            np.testing.assert_array_equal(one.predictions.covariance, expected.predictions.covariance)
    for robot in (other, *robots):
        assert robot._place.regions.learned.any()
        assert robot._place.detections.time_s.min() > 0.1 * 69 - 4.5


def test_regions_of_walkers_do_not_learn_from_furniture():
    """Twenty things that never move are detected as people: the walkers' regions hold as many as without."""
    shares = []
    for things in (0, 20):
        rng, robot, kept = np.random.default_rng(5), OnlinePredictor.load(), []
        where = np.stack([np.full(things, 40.0), np.arange(things)], axis=1)
        start, heading = rng.uniform(-5, 5, (6, 2)), rng.uniform(-np.pi, np.pi, 6)
        truth = np.empty((270, 6, 2))
        for k in range(len(truth)):
            heading += rng.normal(0, 0.05, 6)
            start = start + 0.12 * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
            truth[k] = start
        for k, position in enumerate(truth[:-30]):
            seen = np.concatenate([position + rng.normal(0, 0.02, position.shape), where])
            forecast = robot.update(0.1 * k, np.arange(6 + things), seen)
            if k > 150 and k % 3 == 0:
                after = truth[k + 3 : k + 31 : 3][:10].swapaxes(0, 1)
                kept.append(share_inside(forecast.predictions.select(np.arange(6)), after))
        shares.append([(np.concatenate(kept) <= share).mean() for share in (0.5, 0.9, 0.95)])
    np.testing.assert_allclose(shares[1], shares[0], atol=0.05)


@given(SEEDS, st.floats(-3.0, 3.0), st.integers(1, 49))
@settings(max_examples=4)
def test_a_correction_of_the_world_changes_no_forecast(seed, turn_rad, at):
    """Forecasts, their regions and what is learned go on as if the world had been there from the start."""
    rng = np.random.default_rng(seed)
    shift = rng.normal(0.0, 5.0, 2)
    robot, other = OnlinePredictor.load(), OnlinePredictor.load()
    start, speed = rng.uniform(-6.0, 6.0, (5, 2)), rng.normal(0.0, 0.8, (5, 2))
    for k in range(50):
        seen = start + speed * k / 10 + rng.normal(0.0, 0.02, (5, 2))
        there = rotate(seen, np.float64(turn_rad)) + shift
        if k == at:
            robot.correct(turn_rad, shift)
        found = robot.update(k / 10, np.arange(5), there if k >= at else seen)
        wanted = other.update(k / 10, np.arange(5), there)
        if k >= at:
            for name in ("path", "covariance", "weight"):
                one, two = (getattr(forecast.predictions, name) for forecast in (found, wanted))
                np.testing.assert_allclose(one, two, atol=2e-3)
            np.testing.assert_allclose(found.velocity, wanted.velocity, atol=2e-3)


# Doubts


def rng_of(k):
    return np.random.default_rng(k)


IDS, CROWD = np.arange(6), rng_of(3).uniform(-4, 4, (6, 2))
SPEED = rng_of(4).normal(0, 0.9, (6, 2))
IMPOSSIBLE = {
    "new ids": ("new", lambda k, at: (IDS + 6 * k, at(k))),
    "ids change hands": ("steps", lambda k, at: (rng_of(k).permutation(6), at(k))),
    "the localisation jumps": ("together", lambda k, at: (IDS, at(k) + 0.6 * (k // 10 % 2))),
    "old positions": ("repeats", lambda k, at: (IDS, at(k - k % 10))),
}


def doubts(frame, rate_hz=10, noise_m=0.03, occupancy=None):
    """What is implausible about a stream of 14 s, or of 200 frames."""
    robot = OnlinePredictor.load()
    if occupancy is not None:
        robot.set_map(occupancy)

    def at(k):
        return CROWD + k / rate_hz * SPEED + rng_of(k).normal(0, noise_m, CROWD.shape)

    for k in range(min(200, 14 * rate_hz)):
        robot.update(k / rate_hz, *frame(k, at))
    return {kind for kind, count in robot._doubts.counts.items() if count.text}


@pytest.mark.parametrize("kind", IMPOSSIBLE)
def test_what_detections_cannot_be_is_told(kind, caplog):
    """No single frame is wrong, and forecasts look sound."""
    named, frame = IMPOSSIBLE[kind]
    assert named in doubts(frame)
    assert caplog.records


@pytest.mark.parametrize(("rate_hz", "noise_m"), [(1, 0.15), (10, 0.03), (10, 0.0), (100, 0.15)])
def test_there_is_no_doubt_about_a_sound_stream(rate_hz, noise_m, caplog):
    """Also if a robot's position jumps now and then, and people stop exactly as simulated ones do."""
    every = min(7 * rate_hz, 100)
    assert not doubts(lambda k, at: (IDS, at(k) + 3.0 * (k // every)), rate_hz, noise_m)
    if not noise_m:
        assert not doubts(lambda k, at: (IDS, at(k // 40 * 20 + min(k % 40, 20))), rate_hz, noise_m)


def test_a_map_that_does_not_lie_under_people_is_told():
    def here(k, at):
        return IDS, at(k)

    def ground(cells, corner=(-20.0, -20.0)):
        return OccupancyMap(cells, np.array(corner), 0.1)

    assert doubts(here, occupancy=ground(np.zeros((50, 50), bool), (3e3, 3e3)))
    assert doubts(here, occupancy=ground(rng_of(0).uniform(size=(400, 400)) < 0.3))
    assert not doubts(here, occupancy=ground(np.zeros((400, 400), bool)))
    blocked = ground(np.ones((400, 400), bool))
    assert not doubts(lambda k, at: (IDS, at(0)), occupancy=blocked)  # benches are obstacles


def test_doubts_end_with_their_cause_and_are_copied(caplog):
    robot = OnlinePredictor.load()
    for k in range(60):
        robot.update(0.1 * k, IDS + 6 * k * (k < 30), CROWD + 0.1 * k * SPEED)
        assert robot.doubts == copy.deepcopy(robot).doubts
        assert bool(robot.doubts) == (10 <= k < 40), k
    assert len(caplog.records) == 1
    for k in range(60, 80):
        robot.update(0.1 * k, IDS + 6 * k, CROWD)
    assert robot.doubts
    robot.reset()
    assert not robot.doubts
