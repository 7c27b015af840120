"""What sensors, simulators and other nodes send by mistake: nothing stops a robot's forecasts for long."""

import logging
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from pedpred.errors import PedpredError
from pedpred.online import OnlinePredictor
from pedpred.ros import assignment
from pedpred.ros.assignment import NearestTracks
from pedpred.ros.message_types import UPDATE_TYPE, serialize
from pedpred.ros.planning import HORIZON, MOST_CELLS, fitting_ground, grid_messages, grid_topic
from pedpred.ros.scene_messages import header
from pedpred.ros2.counts import Counts
from pedpred.ros2.diagnostics import Latencies, diagnose, status_values
from pedpred.ros2.log import RosHandler
from pedpred.ros2.outputs import MARKERS
from pedpred.scenes import OccupancyMap, Predictions, predicted_occupancy
from tests.bags import GRID, PEOPLE, TF
from tests.following import answered, follower_of, grid, people, rows_of

SEEDS = st.integers(0, 2**32 - 1)
ODD = st.sampled_from([0.0, -0.0, 1.0, -3.0, 1e-300, 1e8, 1e9, 1e300, np.inf, -np.inf, np.nan])
FRAMES = st.sampled_from(["map", "/map", "", "odom", "camera", "world", "m\u00e4p"])
STAMPS = (
    st.sampled_from([-(2**31), -5, 0, 3, 3, 4, 100, 2**31 - 1]),
    st.sampled_from([0, 1, 10**9, 2**32 - 1]),
)
NAMES = st.sampled_from(
    ["", "anna", "7", "007", "-1", "7.0", "9" * 19, "9" * 5000, "\u0667", "x" * 300, "a\nb"]
)


def headers(frames=FRAMES):
    made = st.builds(lambda sec, nanosec: {"sec": sec, "nanosec": nanosec}, *STAMPS)
    return st.builds(lambda stamp, frame: {"stamp": stamp, "frame_id": frame}, made, frames)


POINTS = st.fixed_dictionaries({"x": ODD, "y": ODD, "z": ODD})
TURNS = st.fixed_dictionaries({"x": ODD, "y": ODD, "z": ODD, "w": ODD}) | st.just({"z": 0.6, "w": 0.8})
LISTED = st.lists(st.fixed_dictionaries({"name": NAMES, "position": POINTS}), max_size=6)
CELLS = st.lists(st.sampled_from([-128, -1, 0, 50, 100, 127]), max_size=9).map(lambda x: np.array(x, np.int8))
SIZES = st.sampled_from([0, 1, 3, 20_000, 2**31, 2**32 - 1])
INFO = st.fixed_dictionaries(
    {
        "resolution": ODD.filter(lambda x: not 1e38 < abs(x) < np.inf) | st.just(0.05),
        "width": SIZES,
        "height": SIZES,
        "origin": st.fixed_dictionaries({"position": POINTS, "orientation": TURNS}),
    }
)
EDGES = st.fixed_dictionaries(
    {
        "header": headers(),
        "child_frame_id": FRAMES,
        "transform": st.fixed_dictionaries({"translation": POINTS, "rotation": TURNS | st.just({"w": 1.0})}),
    }
)
MESSAGES = {
    "people_came": (PEOPLE, st.fixed_dictionaries({"header": headers(), "people": LISTED})),
    "map_came": (GRID, st.fixed_dictionaries({"header": headers(), "info": INFO, "data": CELLS})),
    "map_update_came": (
        UPDATE_TYPE,
        st.fixed_dictionaries(
            {"header": headers(), "x": st.integers(-2, 2), "y": st.integers(-2, 2), "width": SIZES}
            | {"height": SIZES, "data": CELLS}
        ),
    ),
    "transforms_came": (TF, st.fixed_dictionaries({"transforms": st.lists(EDGES, max_size=5)})),
}
SENT = st.one_of(
    *[st.tuples(st.just(name), made.map(lambda one, kind=kind: serialize(kind, one)))
      for name, (kind, made) in MESSAGES.items()],
    st.tuples(st.sampled_from(sorted(MESSAGES)), st.binary(max_size=60)),
)  # fmt: skip
MORE = {"people_came": (10**9,), "transforms_came": (7.0,)}


def take(follower, name, raw, now_s, fixed):
    """Hand over a message as the node does, which tells every error and goes on."""
    more = MORE.get(name, ())
    more += (now_s,) if name == "people_came" else (fixed,) if name == "transforms_came" else ()
    with suppress(PedpredError):
        getattr(follower, name)(raw, *more)


def drain(follower, now_s):
    """Make all answers, as bytes, and go on after an error, as the node does."""
    while True:
        try:
            for answer in follower.answers(now_s):
                serialize(answer.kind, answer.content)
            return
        except PedpredError:
            continue


@settings(max_examples=60)
@given(st.lists(st.tuples(SENT, st.booleans()), max_size=25))
def test_after_whatever_messages_a_sound_stream_is_forecast(sent):
    """From its first frame on, with everybody; and every error on the way can be repaired by a person."""
    follower = follower_of(use_map=True, occupancy_cell_m=0.5)
    for k, ((name, raw), fixed) in enumerate(sent):
        take(follower, name, raw, k / 100, fixed)
        drain(follower, k / 100)
    drain(follower, 10.0)
    status_values(follower, Latencies())
    for k in range(3):
        walk = [("anna", 40.0 + k / 10, 0.0), ("8", 50.0, 0.0)]
        people = [{"name": name, "position": {"x": x, "y": y}} for name, x, y in walk]
        stamp = {"header": header((1000 + k) * 10**9, follower.frame), "people": people}
        answers = answered(follower, serialize(PEOPLE, stamp), 20.0 + k)
        rows = rows_of(answers["predictions"])
        assert len(np.unique(rows[["track_id", "track_high"]])) == 2
        assert all(np.isfinite(rows[name]).all() for name in ("x", "y", "weight", "cov_xx", "cov_yy"))


VALUES = st.one_of(
    ODD,
    st.integers(-(2**70), 2**70),
    st.text(max_size=3),
    st.none(),
    st.booleans(),
    st.sampled_from(
        [2**63 - 1, -(2**63), np.uint64(2**64 - 1), np.float32(3), np.int8(3), 1j, np.datetime64("2020", "s")]
    ),
)
CALLS = st.tuples(
    VALUES | st.floats(0, 3),
    st.lists(VALUES | st.integers(0, 9), max_size=5) | VALUES,
    st.lists(st.lists(VALUES, min_size=1, max_size=3), max_size=5) | VALUES,
)


@settings(max_examples=30)
@given(st.lists(CALLS, max_size=12), SEEDS)
def test_what_a_predictor_refuses_has_never_been(calls, seed):
    """It refuses with an error about an argument, or forecasts; the others are forecast as without it."""
    rng = np.random.default_rng(seed)
    robot, other = OnlinePredictor.load(), OnlinePredictor.load()
    for k in range(len(calls) + 3):
        for time_s, track_id, position in calls[k : k + 1]:
            try:
                found = robot.update(time_s, track_id, position)
            except PedpredError:
                continue
            expected = other.update(time_s, track_id, position)
            np.testing.assert_array_equal(found.predictions.path, expected.predictions.path)
        place = np.array([[0.1 * k, 0.0], [5.0, 0.1]]) + rng.normal(0, 0.02, (2, 2))
        found, expected = (one.update(1e4 + 0.1 * k, [1, 2**62], place) for one in (robot, other))
        assert found.track_id[-1] == 2**62
        assert np.isfinite(found.predictions.path).all()
        np.testing.assert_array_equal(found.predictions.path, expected.predictions.path)


@pytest.mark.parametrize("yaw_rad", [0.0, 0.3])
@pytest.mark.parametrize(
    "odd",
    [
        {"width": 0, "values": 0},
        {"width": 20_000, "height": 20_000, "values": 10},
        {"values": 11},
        {"values": 13},
        {"x": np.nan},
        {"x": np.inf},
        {"x": 1e300},
        {"resolution": 0.0},
        {"resolution": -1.0},
        {"resolution": np.nan},
        {"resolution": 1e-9},
        {"resolution": 1e30},
    ],
    ids=str,
)
def test_a_map_that_is_none_is_refused_and_the_one_before_stays(odd, yaw_rad):
    follower = follower_of(use_map=True)
    follower.map_came(grid(np.zeros((3, 4))))
    before, about = follower.occupancy, {"width": 4, "height": 3} | odd
    cells, corner = np.zeros((1, about.pop("values", 12))), {"x": about.pop("x", 0.0)}
    with pytest.raises(PedpredError):
        follower.map_came(grid(cells, yaw_rad, position=corner, **about))
    assert follower.occupancy is before
    follower.map_came(grid(np.zeros((1, 1))))
    assert follower.occupancy.occupied.shape == (1, 1)


# Crowds


@pytest.mark.parametrize("identities", ["given", "assigned"])
def test_of_too_many_people_those_who_came_first_are_forecast_and_others_counted(identities, caplog):
    follower = follower_of(identities=identities, most_people=3)
    for k, count in enumerate((2, 5000, 5000)):
        walk = [{"name": str(n), "position": {"x": 5.0 * n, "y": k / 10}} for n in range(count)]
        raw = serialize(PEOPLE, {"header": header(10**9 + k * 10**8), "people": walk})
        rows = rows_of(answered(follower, raw)["predictions"])
        first = int(identities == "assigned")
        assert np.unique(rows["track_id"]).tolist() == [*range(first, first + min(count, 3))]
    assert "4997 of 5000 people at 1.1 s left out, since most_people is 3" in caplog.text
    assert status_values(follower, Latencies())["left out: people without a forecast"] == 2 * 4997


def test_when_forecasts_take_too_long_late_messages_are_left_out_until_the_rest_is_in_time(caplog):
    """Waits in a queue that fills, s, and whether each message is forecast."""
    follower = follower_of(max_wait_s=2.0)
    waits = {0.0: True, 1.9: True, 2.1: False, 1.0: False, 0.3: False, 0.1: True, 1.8: True}
    for k, (waited_s, is_forecast) in enumerate(waits.items()):
        raw = serialize(PEOPLE, {"header": header((10 + k) * 10**8)})
        follower.people_came(raw, 0, 0.0, waited_s)
        assert bool(list(follower.answers(0.0))) == is_forecast
    assert "Forecasts take too long" in caplog.text
    assert follower.counts.slow == 3


def test_unless_told_otherwise_no_forecast_is_of_people_who_waited_for_longer_than_a_step():
    for waited_s, is_forecast in ((0.25, True), (0.35, False)):
        follower = follower_of()
        follower.people_came(serialize(PEOPLE, {"header": header(10**9)}), 0, 0.0, waited_s)
        assert bool(list(follower.answers(0.0))) == is_forecast


def test_diagnostics_say_that_forecasts_are_late_or_stamps_of_another_clock():
    follower = follower_of()
    answered(follower, named(1.0, "7"))
    assert diagnose(follower, 0.0, 1, Counts(), latency_ms=250.0) == (0, "forecasts")
    assert "forecasts come 1700 ms after people" in diagnose(follower, 0.0, 1, Counts(), latency_ms=1700.0)[1]
    for age_s in (9.0, -5.0):
        follower.people_came(named(60.0, "7"), round((60.0 + age_s) * 1e9), 0.0)
        assert f"people are stamped {age_s:.1f} s ago" in diagnose(follower, 0.0, 1, Counts())[1]


def test_diagnostics_say_when_people_come_and_forecasts_do_not():
    """As where all stamps are the same."""
    follower = follower_of()
    for k in range(50):
        answered(follower, serialize(PEOPLE, {"header": header(10**9)}), k / 10)
        level, text = diagnose(follower, k / 10, 1, Counts())
    assert level == 1
    assert "of the last 50 messages of people, 49 are left out" in text
    assert status_values(follower, Latencies())["left out: earlier than another"] == 49


def test_two_clocks_are_told():
    follower = follower_of()
    for k in range(10):
        answered(follower, named((1.0 if k % 2 else 1000.0) + k / 10, "7"), k / 10)
    assert "do two clocks stamp people?" in diagnose(follower, 1.0, 1, Counts())[1]
    assert diagnose(follower, 1.0, 1, replace(follower.counts)) == (0, "forecasts")


# Who is who


def named(time_s, *names, step_m=0.1):
    """People in a row who walk; the k-th is called names[k]."""
    places = [{"x": step_m * 10 * time_s, "y": 3.0 * row} for row in range(len(names))]
    people = [{"name": name, "position": place} for name, place in zip(names, places, strict=True)]
    return serialize(PEOPLE, {"header": header(round(time_s * 1e9)), "people": people})


def tracks_of(answers):
    rows = rows_of(answers["predictions"])
    return set((rows["track_high"].astype(np.int64) * 2**32 + rows["track_id"]).tolist())


def test_ids_that_do_not_stay_with_people_are_not_used(caplog):
    follower = follower_of()
    for k in range(80):
        answers = answered(follower, named(1.0 + k / 10, f"a{k}", f"b{k}"))
    assert any(record.name == "pedpred.ros.identities" for record in caplog.records)
    assert len(tracks_of(answers)) == 2
    assert rows_of(answers["predictions"])["x"].max() > 8.9 + 1.0  # they are seen to walk


def test_warnings_name_people_as_the_messages_do(caplog):
    follower = follower_of(most_people=2)
    answered(follower, named(1.0, "ada", "7"))
    answered(follower, named(1.1, "ada", "7", "eve", "8f1c-22", "9", ""))
    assert "most_people is 2: tracks ['#1', " in caplog.text
    assert all(f"'{name}'" in caplog.text for name in ("eve", "8f1c-22", "9"))


def test_who_has_no_id_among_others_is_forecast_under_a_number_that_stays(caplog):
    follower, found = follower_of(), []
    for k in range(10):
        found.append(tracks_of(answered(follower, named(1.0 + k / 10, "7", "", "eve"))))
    assert len(found[0]) == 3
    assert all(one == found[0] for one in found)
    assert caplog.records


@pytest.mark.parametrize("first", [0, 12])
def test_who_stands_stands_also_where_ids_come_and_go(first):
    """The numbers of the nearest people are nobody's ids, so nobody seems to jump to where another one is."""
    follower, places = follower_of(), [{"x": 0.0, "y": 0.8}, {"x": 0.0, "y": 0.0}]
    for k in range(60):
        names = ("", "") if (k + first) // 12 % 2 else ("2", "1")
        people = [{"name": name, "position": at} for name, at in zip(names, places, strict=True)]
        content = {"header": header(10**9 + k * 10**8), "people": people[:: 1 - 2 * (k % 2)]}
        answers = answered(follower, serialize(PEOPLE, content))
        here = answers["predictions/people"]["people"]
        assert max(abs(person["velocity"][axis]) for person in here for axis in "xy") < 0.01
        assert {person["name"] for person in here} <= {"1", "2", "#1", "#2", "#3", "#4", "#5", "#6"}


@pytest.mark.parametrize("other", ["", str(2**32 + 1)])
def test_viewers_keep_everybody_whatever_the_ids(other):
    """They keep one marker of each namespace and number, and numbers of markers have 32 bits."""
    follower = follower_of()
    answered(follower, people(5.0, **{"1": (0.0, 0.0), other: (3.0, 1.0)}))
    markers = answered(follower, people(5.1, **{"1": (0.0, 0.0), other: (3.0, 1.0)}))[MARKERS]["markers"][1:]
    assert len({(one["ns"], one["id"]) for one in markers}) == len(markers) > 0
    assert sum(one["ns"] == "names" for one in markers) == 2


@given(SEEDS, st.integers(1, 40), st.floats(2.0, 30.0))
@settings(max_examples=30)
def test_the_nearest_are_those_of_the_whole_assignment(seed, count, side_m):
    """Leaving out those whom nobody is near changes no pair."""
    rng = np.random.default_rng(seed)
    before, after = rng.uniform(0, side_m, (count, 2)), rng.uniform(0, side_m, (count, 2))
    tracks = NearestTracks()
    tracks.assign(0.0, before)
    found = tracks.assign(0.1, after)
    apart, gate = cdist(before, after), assignment._GATE_M + 0.1 * assignment._GATE_MPS
    costs = np.where(apart <= gate, apart, 2 * assignment._LARGEST_GATE_M)
    row, column = linear_sum_assignment(costs)
    paired = apart[row, column] <= gate
    expected = np.zeros(count, int)
    expected[column[paired]] = row[paired] + 1
    assert (found[expected == 0] > count).all()
    kept = found <= count
    total = (
        costs[found[kept] - 1, np.flatnonzero(kept)].sum() + (~kept).sum() * 2 * assignment._LARGEST_GATE_M
    )
    assert total == pytest.approx(costs[row, column].sum())


def test_detections_that_are_noise_do_not_pile_up():
    rng, tracks = np.random.default_rng(0), NearestTracks()
    for k in range(30):
        tracks.assign(k / 1000, rng.uniform(-1e4, 1e4, (300, 2)))
        assert len(tracks._track_id) <= assignment._MOST_TRACKS + 300


# Predicted occupancy


@given(SEEDS, st.integers(0, 4), st.sampled_from([3.0, 30.0, 300.0]))
@settings(max_examples=40)
def test_grids_are_those_of_the_whole_ground_wherever_people_are(seed, people, spread_m):
    rng = np.random.default_rng(seed)
    path = rng.normal(0, spread_m, (people, 2, 3, 2))
    weight = np.tile([0.7, 0.3], (people, 1))
    covariance = np.eye(2) * rng.uniform(1e-4, 1.0, (people, 2, 3, 1, 1))
    forecasts = Predictions((weight[..., None, None] * path).sum(1), path, weight, 0.3, covariance)
    ground = OccupancyMap(np.zeros((70, 40), bool), np.array([-20.0, -7.0]), 0.5)
    expected = np.rint(100 * predicted_occupancy(forecasts, ground)).astype(int)
    found = grid_messages(forecasts, ground, 0, "map", horizon=True)
    cells = [np.asarray(found[grid_topic(step + 1)]["data"]).reshape(40, 70).T for step in range(3)]
    assert np.abs(np.array(cells) - expected).max() <= 1
    np.testing.assert_array_equal(found[HORIZON]["data"], np.max(cells, axis=0).T.ravel())


@given(st.integers(1, 300), st.integers(1, 300), st.floats(-3, 6), st.floats(-1, 1), st.integers(1, 20))
def test_the_cells_of_predicted_occupancy_are_never_too_many(width, height, side, cell, steps):
    """Nor larger than asked for without need."""
    ground = OccupancyMap(np.zeros((width, height), bool), np.zeros(2), 10.0**side)
    cut = fitting_ground(ground, 10.0**cell, steps)
    assert cut.occupied.size * steps <= MOST_CELLS
    assert cut.resolution_m == 10.0**cell or cut.occupied.size * steps > MOST_CELLS / 8
    assert (cut.extent_m >= ground.extent_m * (1 - 1e-9)).all()


def test_a_large_map_has_larger_cells_and_a_warning(caplog):
    follower = follower_of(use_map=True, occupancy_cell_m=0.1)
    follower.map_came(grid(np.zeros((1000, 1000))))
    answers = answered(follower, named(1.0, "7"))
    assert answers["predicted_occupancy/horizon"]["info"]["resolution"] > 0.1
    assert any(record.name == "pedpred.ros2.views" for record in caplog.records)


# The log


class Kept:
    """A logger of rclpy that keeps what it is told."""

    def __init__(self):
        self.told = []

    def error(self, text):
        """Keep a text."""
        self.told.append(text)

    warning = info = error


def test_kinds_of_errors_do_not_hide_each_other_and_do_not_pile_up():
    kept = Kept()
    handler, log = RosHandler(kept), logging.Logger("node")
    log.addHandler(handler)
    for k in range(3000):
        log.error("message left out: %s", k, extra={"kind": ("people", "ValueRuleError", "id")})
        log.error("message left out: %s", k, extra={"kind": ("map", "ValueRuleError", "data")})
        log.error(f"wording {k}")
    assert sum("message left out" in text for text in kept.told) <= 2 + 2 * 2
    assert {"message left out: 0", "wording 2999"} <= set(kept.told)
    assert len(handler._latest) < 1100
