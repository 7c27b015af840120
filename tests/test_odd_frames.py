"""Odd times, ids, coordinates and velocities: refused before anything changes, or forecast."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.frame import Frame
from pedpred.online.people import People
from pedpred.online.registration import contradicted, register_detections
from pedpred.tracking import KalmanBank, KalmanSettings
from tests.refused import refused


def walked(robot, times, track=1):
    """The last forecast of a person who walks along x at 1 m/s."""
    for now in times:
        last = robot.update(now, [track], [[float(now) % 1000.0, 0.0]])
    return last


@pytest.fixture
def robots(model):
    """Two equal predictors, with memory."""
    return OnlinePredictor.load(model[0]), OnlinePredictor.load(model[0])


BAD = [
    ((np.nan, [1], [[0, 0]]), "time_s"),
    ((1.7e12, [1], [[0, 0]]), "time_s"),
    ((2.0, [1, 1], [[0, 0], [1, 1]]), "track_id"),
    ((2.0, [1.5], [[0, 0]]), "track_id"),
    ((2.0, np.array([1, 2**64 - 1], np.uint64), [[0, 0]] * 2), "track_id[1]"),
    ((2.0, [1, 2], [[0, 0], [np.nan, 0]]), "position[1]"),
    ((2.0, [1, 2], [[0, 0], [1e9, 0]]), "position[1]"),
    ((2.0, [1], [[0, 0]], [[1e300, 0]]), "velocity[0]"),
    ((2.0, [1, 2], [[0, 0], [1]]), "position"),
    ((2.0, [1, 2], [[0, 0]]), "position"),
]


def test_a_bad_frame_is_refused_and_changes_nothing(robots):
    for predictor in robots:
        predictor.update(1.0, [1], [[0.0, 0.0]])
    for frame, field in BAD:
        with refused(field):
            robots[0].update(*frame)
    for correction, field in (((np.nan, [0, 0]), "turn_rad"), ((0.0, [np.inf, 0]), "shift")):
        with refused(field):
            robots[0].correct(*correction)
    a, b = (predictor.update(1.3, [1], [[0.4, 0.0]]) for predictor in robots)
    np.testing.assert_array_equal(a.position, b.position)


def test_a_frame_that_fails_half_way_is_not_consumed(robots, monkeypatch):
    for predictor in robots:
        walked(predictor, (0.0, 0.2, 0.4))
    with monkeypatch.context() as patch:
        patch.setattr(robots[0]._steps, "inputs", lambda *_: (_ for _ in ()).throw(MemoryError))
        with pytest.raises(MemoryError):
            robots[0].update(1.5, [1, 2], [[1.5, 0.0], [3.0, 0.0]])
    with refused("occupancy"):
        robots[0].set_map(None)
    a, b = (walked(predictor, (1.5, 1.8)) for predictor in robots)
    np.testing.assert_array_equal(a.track_id, b.track_id)
    np.testing.assert_array_equal(a.position, b.position)


def test_who_cannot_be_forecast_is_left_out_and_named(robots, monkeypatch, caplog):
    """A network that gives no numbers for one person costs that person alone a forecast, and its memory."""
    robot, other = robots
    session = robot.network._session

    class Broken:
        def run(self, names, values):
            found = [tensor.copy() for tensor in session.run(names, values)]
            found[0][1] = np.nan
            return found

    ids = [3, 5, 8]
    for k in range(5):
        position = [[0.1 * k, 0.0], [20.0, 0.1 * k], [40.0, 0.0]]
        with monkeypatch.context() as patch:
            if k == 4:
                patch.setattr(robot.network, "_session", Broken())
            found, expected = (one.update(0.1 * k, ids, position) for one in (robot, other))
    assert found.track_id.tolist() == [3, 8]
    assert caplog.records
    np.testing.assert_allclose(found.predictions.path, expected.predictions.path[[0, 2]], atol=1e-4)
    again = robot.update(0.5, ids, position)
    assert again.track_id.tolist() == ids
    assert np.isfinite(again.predictions.path).all()


# Clocks


@pytest.mark.parametrize("false_s", [2.0**32 - 1, -1e6])
def test_a_false_stamp_costs_a_fresh_start_and_no_more(robots, false_s, caplog):
    walked(robots[0], (0.0, 0.2, 0.4))
    assert len(robots[0].update(false_s, [1], [[0.5, 0.0]])) == 1
    a, b = (walked(predictor, (0.6, 0.8, 1.0)) for predictor in robots)
    np.testing.assert_array_equal(a.position, b.position)
    assert caplog.records


@settings(max_examples=5)
@given(lag_s=st.floats(0.01, 0.48), rate_hz=st.sampled_from([2.5, 10.0, 25.0]), phase=st.floats(0.0, 1.0))
def test_people_of_a_late_sensor_are_forecast_too(mixture, lag_s, rate_hz, phase):
    robot = OnlinePredictor.load(mixture[0])
    for k in range(30):
        now = k / rate_hz
        assert 1 in robot.update(now, [1], [[now, 0.0]]).track_id
        late_s = now + phase / rate_hz - lag_s
        forecast = robot.update(late_s, [2], [[late_s, 3.0]])
        assert set(forecast.track_id) == {1, 2}
    assert forecast.track_id.tolist() == [1, 2]


@pytest.mark.parametrize("start_s", [0.0, 2.0**32 - 10, -(2.0**32) + 10])
def test_a_frame_asks_the_network_as_often_at_any_time(robots, start_s, monkeypatch):
    """However long the time between two stamps is, no steps are made up for it."""
    robot, asked = robots[0], []
    inputs_of = robot._steps.inputs
    monkeypatch.setattr(robot._steps, "inputs", lambda *given: asked.append(1) or inputs_of(*given))
    walked(robot, (0.0,))
    for k in range(10):
        robot.update(start_s + k / 3 if k % 2 else 500.0 * k, [1], [[0.0, 0.0]])
    assert len(asked) <= 11


def test_arguments_and_answers_are_nobody_elses(robots):
    """Writing into what was passed changes nothing; what is returned cannot be written into."""
    robot, other = robots
    now, names, here = np.array(0.0), np.array([1, 2]), np.zeros((2, 2))
    for _ in range(4):
        forecast = robot.update(now, names, here, here)
        expected = other.update(float(now), [1, 2], here.tolist(), here.tolist())
        np.testing.assert_array_equal(forecast.position, expected.position)
        now += 0.2
        here += 0.1
        names += 1
        names -= 1
    dropped = robot.update(0.0, [1], [[0.0, 0.0]])
    for answer in (forecast, dropped):
        for values in (answer.track_id, answer.velocity, answer.position, answer.predictions.path):
            assert not values.flags.writeable


# Crowds


def placed(ids):
    """Arguments of a frame in which each id has a place of its own."""
    return ids, [[10.0 * name, 0.1 * name] for name in ids]


def test_of_too_many_people_the_first_are_forecast_as_if_alone(model, caplog):
    robot = OnlinePredictor.load(model[0], OnlineSettings(most_people=3))
    other = OnlinePredictor.load(model[0])
    for k in range(12):
        is_full = k > 2
        crowd = [5, 7, *range(-9, 0)] if is_full else [5, 7]
        found = robot.update(k / 10, *placed(crowd))
        alone = other.update(k / 10, *placed([5, 7, -9] if is_full else [5, 7]))
        np.testing.assert_array_equal(found.track_id, alone.track_id)
        np.testing.assert_array_equal(found.predictions.path, alone.predictions.path)
        assert bool(caplog.records) == is_full
    assert robot.update(1.2, *placed([5, *range(-9, 0)])).track_id.tolist() == [-9, -8, 5]


@given(st.lists(st.lists(st.integers(0, 9), unique=True, max_size=8), max_size=20), st.integers(1, 9))
@settings(max_examples=15)
def test_no_more_people_are_followed_than_the_limit_says(frames, most):
    """People who are followed and detected again stay; with room for all, none is left out."""
    robot, other = OnlinePredictor.load(None, OnlineSettings(most_people=most)), OnlinePredictor.load()
    before = []
    for k, ids in enumerate(frames):
        forecast, unlimited = (one.update(k / 10, *placed(ids)) for one in (robot, other))
        found = forecast.track_id.tolist()
        assert len(found) <= most
        assert {*before} & {*ids} <= {*found} <= {*unlimited.track_id.tolist()}
        assert len({*ids} & {*found}) == min(len(ids), most)
        before = found


# Velocities


def test_an_impossible_velocity_spoils_no_forecast_of_others(robots, caplog):
    """It counts as 10 m/s: one of 10 km/s moved the forecasts of others by hundreds of metres."""
    position = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 5.0]])
    for k in range(6):
        both = []
        for fast, robot in zip((10.0, 1e4), robots, strict=True):
            velocity = np.array([[1.0, 0.0], [0.0, fast], [0.0, -1.0]])
            both.append(robot.update(0.1 * k, [7, 8, 9], position + 0.1 * k * velocity.clip(-1, 1), velocity))
    np.testing.assert_array_equal(both[1].predictions.path, both[0].predictions.path)
    assert caplog.records


def test_velocities_that_do_not_fit_positions_cause_one_warning(robots, caplog):
    """As those of a tracker that fills in zeros."""
    for k in range(40):
        robots[0].update(0.1 * k, [7, 8], [[0.12 * k, 0.0], [0.12 * k, 3.0]], [[0.0, 0.0], [1.2, 0.0]])
    assert len(caplog.records) == 1


@settings(max_examples=10)
@given(
    st.sampled_from([0.5, 2.5, 10.0, 60.0]), st.floats(0.0, 3.0), st.floats(-1.0, 1.0), st.floats(0.0, 0.1)
)
def test_true_velocities_are_believed_at_any_rate_and_noise(rate_hz, speed_mps, turn_radps, noise_m):
    rng, people = np.random.default_rng(0), People.nobody({}, 2)
    bank = KalmanBank.around(KalmanSettings(0.03, 0.05), learn_noise=False)
    for k in range(100):
        now = k / rate_hz
        angle = turn_radps * now
        ahead = np.array([np.cos(angle / 2), np.sin(angle / 2)])
        where = speed_mps * now * np.sinc(angle / 2 / np.pi) * ahead + noise_m * rng.normal(size=2)
        velocity = speed_mps * np.array([[np.cos(angle), np.sin(angle)]])
        frame = Frame.checked(now, [1], [where], velocity)
        people = register_detections(people, frame, bank, 0.2, 0)
        assert not contradicted(people).any()
