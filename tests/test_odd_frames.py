"""Odd times, ids, coordinates and velocities: refused before anything changes, or forecast."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.errors import PedpredError, ValueRuleError
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.frame import Frame
from pedpred.online.people import People
from pedpred.online.registration import contradicted, register_detections
from pedpred.tracking import KalmanBank, KalmanSettings


def walked(robot, times, track=1):
    """The last forecast of a person who walks along x at 1 m/s."""
    for now in times:
        last = robot.update(now, [track], [[float(now) % 1000.0, 0.0]])
    return last


@pytest.fixture(params=["model", "mixture"])
def folder(request):
    """With and without memory."""
    return request.getfixturevalue(request.param)[0]


@pytest.mark.parametrize(
    ("frame", "field"),
    [
        ((np.nan, [1], [[0, 0]]), "time_s"),
        ((1.7e12, [1], [[0, 0]]), "time_s"),
        ((None, [1], [[0, 0]]), "time_s"),
        ((2.0, [1, 1], [[0, 0], [1, 1]]), "track_id"),
        ((2.0, [1.5], [[0, 0]]), "track_id"),
        ((2.0, np.array([1, 2**64 - 1], np.uint64), [[0, 0]] * 2), "track_id[1]"),
        ((2.0, [1, 2], [[0, 0], [np.nan, 0]]), "position[1]"),
        ((2.0, [1, 2], [[0, 0], [1e9, 0]]), "position[1]"),
        ((2.0, [1], [[0, 0]], [[1e300, 0]]), "velocity[0]"),
        ((2.0, [1, 2], [[0, 0], [1]]), "position"),
        ((2.0, [1], [["a", "b"]]), "position"),
        ((2.0, [1, 2], [[0, 0]]), "position"),
    ],
    ids=str,
)
def test_a_bad_frame_is_refused_and_changes_nothing(folder, frame, field):
    robot, other = OnlinePredictor.load(folder), OnlinePredictor.load(folder)
    for predictor in (robot, other):
        predictor.update(1.0, [1], [[0.0, 0.0]])
    with pytest.raises(PedpredError) as error:
        robot.update(*frame)
    assert error.value.field == field
    a, b = (predictor.update(1.3, [1], [[0.4, 0.0]]) for predictor in (robot, other))
    np.testing.assert_array_equal(a.position, b.position)


def test_a_frame_that_fails_half_way_is_not_consumed(folder, monkeypatch):
    robot, other = OnlinePredictor.load(folder), OnlinePredictor.load(folder)
    for predictor in (robot, other):
        walked(predictor, (0.0, 0.2, 0.4))
    with monkeypatch.context() as patch:
        patch.setattr(robot._steps, "inputs", lambda *_: (_ for _ in ()).throw(MemoryError))
        with pytest.raises(MemoryError):
            robot.update(1.5, [1, 2], [[1.5, 0.0], [3.0, 0.0]])
    with pytest.raises(ValueRuleError):
        robot.set_map(None)
    a, b = (walked(predictor, (1.5, 1.8)) for predictor in (robot, other))
    np.testing.assert_array_equal(a.track_id, b.track_id)
    np.testing.assert_array_equal(a.position, b.position)


@pytest.mark.parametrize("false_s", [1e6, 2.0**32 - 1, -1e6])
def test_a_false_stamp_costs_a_fresh_start_and_no_more(folder, false_s, caplog):
    robot, other = OnlinePredictor.load(folder), OnlinePredictor.load(folder)
    walked(robot, (0.0, 0.2, 0.4))
    assert len(robot.update(false_s, [1], [[0.5, 0.0]])) == 1
    a, b = (walked(predictor, (0.6, 0.8, 1.0)) for predictor in (robot, other))
    np.testing.assert_array_equal(a.position, b.position)
    assert caplog.records


FALSE_S = st.floats(0.26, 3.0)
RATES_HZ = st.sampled_from([2.5, 5.0, 10.0, 25.0])


@settings(max_examples=20, deadline=None)
@given(away_s=FALSE_S, rate_hz=RATES_HZ, is_set=st.booleans())
def test_no_clock_that_goes_back_silences_a_stream(mixture, away_s, rate_hz, is_set):
    """A clock is set back, or a single stamp was ahead: 0.3 s later, people are forecast as at a start."""
    robot, other = OnlinePredictor.load(mixture[0]), OnlinePredictor.load(mixture[0])
    before = np.arange(10) / rate_hz
    walked(robot, before)
    if not is_set:
        walked(robot, [before[-1] + away_s])
    begin_s = before[-1] + 1 / rate_hz - (away_s if is_set else 0.0)
    times, fresh_from = begin_s + np.arange(60) / rate_hz, None
    for now in times:
        forecast = walked(robot, [now])
        if fresh_from is None and forecast.time_s == now:
            fresh_from = now
        if fresh_from is not None:
            expected = walked(other, [now])
            assert forecast.time_s == now
    assert fresh_from - begin_s <= 0.3 + 1 / rate_hz + 1e-6
    np.testing.assert_allclose(forecast.position, expected.position, atol=0.01)


@settings(max_examples=20, deadline=None)
@given(lag_s=st.floats(0.01, 0.48), rate_hz=RATES_HZ, phase=st.floats(0.0, 1.0))
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
def test_a_frame_asks_the_network_as_often_at_any_time(folder, start_s, monkeypatch):
    """However long the time between two stamps is, no steps are made up for it."""
    robot, asked = OnlinePredictor.load(folder), []
    inputs_of = robot._steps.inputs
    monkeypatch.setattr(robot._steps, "inputs", lambda *given: asked.append(1) or inputs_of(*given))
    walked(robot, (0.0,))
    for k in range(10):
        robot.update(start_s + k / 3 if k % 2 else 500.0 * k, [1], [[0.0, 0.0]])
    assert len(asked) <= 11


def test_arguments_and_answers_are_nobody_elses(folder):
    """Writing into what was passed changes nothing; what is returned cannot be written into."""
    robot, other = OnlinePredictor.load(folder), OnlinePredictor.load(folder)
    now, names, here = np.array(0.0), np.array([1, 2]), np.zeros((2, 2))
    for _ in range(4):
        forecast = robot.update(now, names, here, here)
        expected = other.update(float(now), [1, 2], here.tolist(), here.tolist())
        assert isinstance(forecast.time_s, float)
        np.testing.assert_array_equal(forecast.position, expected.position)
        now += 0.2
        here += 0.1
        names += 1
        names -= 1
    dropped = robot.update(0.0, [1], [[0.0, 0.0]])
    for answer in (forecast, dropped):
        for values in (answer.track_id, answer.velocity, answer.position, answer.predictions.path):
            with pytest.raises(ValueError, match="read-only"):  # of numpy
                values[:] = 7


def placed(ids):
    """Arguments of a frame in which each id has a place of its own."""
    return ids, [[10.0 * name, 0.1 * name] for name in ids]


def test_of_too_many_people_the_first_are_forecast_as_if_alone(folder, caplog):
    robot, other = OnlinePredictor.load(folder, OnlineSettings(most_people=3)), OnlinePredictor.load(folder)
    for k in range(12):
        crowd = [5, 7, *range(-9, 0)] if k > 2 else [5, 7]
        found, alone = (
            robot.update(k / 10, *placed(crowd)),
            other.update(k / 10, *placed([5, 7, -9][: 2 + (k > 2)])),
        )
        np.testing.assert_array_equal(found.track_id, alone.track_id)
        np.testing.assert_array_equal(found.predictions.path, alone.predictions.path)
        assert bool(caplog.records) == (k > 2)
    assert robot.update(1.2, *placed([5, *range(-9, 0)])).track_id.tolist() == [-9, -8, 5]


@given(st.lists(st.lists(st.integers(0, 9), unique=True, max_size=8), max_size=30), st.integers(1, 9))
@settings(max_examples=40)
def test_no_more_people_are_followed_than_the_limit_says(frames, most):
    """People who are followed and detected again stay; with room for all, none is left out."""
    robot, other, before = (
        OnlinePredictor.load(None, OnlineSettings(most_people=most)),
        OnlinePredictor.load(),
        [],
    )
    for k, ids in enumerate(frames):
        forecast, unlimited = (one.update(k / 10, *placed(ids)) for one in (robot, other))
        found = forecast.track_id.tolist()
        assert len(found) <= most
        assert {*before} & {*ids} <= {*found} <= {*unlimited.track_id.tolist()}
        assert len({*ids} & {*found}) == min(len(ids), most)
        if len({*np.concatenate(frames[: k + 1])}) <= most:
            np.testing.assert_array_equal(forecast.predictions.path, unlimited.predictions.path)
        before = found


def test_an_impossible_velocity_spoils_no_forecast_of_others(folder, caplog):
    """It counts as 10 m/s: one of 10 km/s moved the forecasts of others by hundreds of metres."""
    robots = [OnlinePredictor.load(folder) for _ in "ab"]
    position = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 5.0]])
    for fast, robot in zip((10.0, 1e4), robots, strict=True):
        for k in range(6):
            velocity = np.array([[1.0, 0.0], [0.0, fast], [0.0, -1.0]])
            forecast = robot.update(0.1 * k, [7, 8, 9], position + 0.1 * k * velocity.clip(-1, 1), velocity)
        robot.kept = forecast
    np.testing.assert_array_equal(robots[1].kept.predictions.path, robots[0].kept.predictions.path)
    assert caplog.records


@pytest.mark.parametrize("given", [[0.0, 0.0], [-1.0, 0.0], [0.0, 1.2]])
def test_velocities_that_do_not_fit_positions_cause_one_warning(folder, given, caplog):
    """As those of a tracker that fills in zeros."""
    robot = OnlinePredictor.load(folder)
    for k in range(80):
        robot.update(0.1 * k, [7, 8], [[0.12 * k, 0.0], [0.12 * k, 3.0]], [given, [1.2, 0.0]])
    assert len(caplog.records) == 1


@settings(max_examples=20, deadline=None)
@given(
    st.sampled_from([0.5, 1.0, 2.5, 10.0, 60.0]),
    st.floats(0.0, 3.0),
    st.floats(-1.0, 1.0),
    st.floats(0.0, 0.1),
)
def test_true_velocities_are_believed_at_any_rate_and_noise(rate_hz, speed_mps, turn_radps, noise_m):
    rng, people = np.random.default_rng(0), People.nobody({}, 2)
    bank = KalmanBank.around(KalmanSettings(0.03, 0.05), learn_noise=False)
    for now in np.arange(0.0, 30.0, 1.0 / rate_hz):
        angle = turn_radps * now
        where = (
            speed_mps * now * np.sinc(angle / 2 / np.pi) * np.array([np.cos(angle / 2), np.sin(angle / 2)])
        )
        velocity = speed_mps * np.array([[np.cos(angle), np.sin(angle)]])
        frame = Frame.checked(now, [1], [where + noise_m * rng.normal(size=2)], velocity)
        people = register_detections(people, frame, bank, 0.2, 0)
        assert not contradicted(people).any()
