"""What the ROS node does between messages: bytes as they are on the wire in, contents of messages out."""

import struct
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pedpred.errors import ValueRuleError
from pedpred.ros.grids import HORIZON, grid_messages
from pedpred.ros.message_types import known_types, serialize
from pedpred.ros.people import PEOPLE_FIELDS
from pedpred.ros.scene_messages import header
from pedpred.ros2.outputs import MARKERS, output_types
from pedpred.ros2.settings import NodeSettings
from pedpred.ros2.wire import decode
from pedpred.scenes import OccupancyMap, Predictions
from tests.bags import GRID, PEOPLE, Store
from tests.following import (
    UNMOVED,
    answered,
    contents,
    crowd,
    follower_of,
    move,
    people,
    rows_of,
    seen,
    tracks_of,
)
from tests.robots import STANDING, from_robot, robot

POSES, BOXES = "geometry_msgs/msg/PoseArray", "vision_msgs/msg/Detection3DArray"


def test_every_output_is_a_message_of_its_type():
    follower = follower_of(occupancy_cell_m=0.5)
    published = answered(follower, people(5.0, anna=(0.0, 0.0), **{"7": (2.0, 1.0)}))
    types = output_types(follower.settings, 10)
    assert published.keys() == types.keys()
    for topic, content in published.items():
        known_types().deserialize_cdr(serialize(types[topic], content), types[topic])
    assert seen(published).keys() == {"anna", "7"}
    assert answered(follower, people(4.8, anna=(0.0, 0.0))) == {}  # late
    assert follower.counts.late == 1


@pytest.mark.parametrize("kind", [PEOPLE, POSES])
@pytest.mark.parametrize("frame", ["map", "camera"])
def test_a_message_without_people_is_answered_on_every_topic(kind, frame, caplog):
    follower = follower_of(use_map=True, people_type=kind, occupancy_cell_m=0.5)
    published = answered(follower, serialize(kind, {"header": header(10**9, frame)}))
    assert published.keys() == output_types(follower.settings, 10).keys() - {"predictions/names"}
    assert published["predictions"]["width"] == 0
    assert not caplog.records


@pytest.mark.parametrize("kind", sorted(PEOPLE_FIELDS))
def test_people_of_every_type_are_followed(kind):
    """Two people who walk; types without ids that last get them from the nearest."""
    follower, store = follower_of(people_type=kind), Store()
    for k in range(15):
        here = {"0": (0.1 * k, 1.0), "1": (5.0 - 0.05 * k, 1.0)}
        message = store.people(kind, 1.0 + k / 10, here)
        published = answered(follower, store.raw(kind, message))
    rows = rows_of(published["predictions"])
    last = rows[(rows["mode"] == 0) & (rows["step"] == 10)]
    if PEOPLE_FIELDS[kind].id not in ("", "uuid.uuid"):
        assert last["track_id"].tolist() == [0, 1]
    np.testing.assert_allclose(np.sort(last["x"]), [2.8, 4.3], atol=0.6)


def test_fields_of_any_type_can_be_named():
    """Messages of an unknown type are decoded by the node; here by the known definition."""
    kind, store = "spencer_tracking_msgs/msg/TrackedPersons", Store()
    fields = {
        "people_type": "my_msgs/msg/Tracks",
        "people_fields": "tracks,id=track_id,position=pose.pose.position",
    }
    follower = follower_of(**fields)
    follower.inbox._decode_people = lambda raw: decode(raw, kind)
    raw = store.raw(kind, store.people(kind, 1.0, {0: (1.0, 1.0), 1: (3.0, 1.0)}))
    assert tracks_of(answered(follower, raw)) == {0, 1}


@pytest.mark.parametrize(
    ("class_ids", "expected"), [(("person",), {1}), (("chair", "person"), {1, 2}), (("",), {1, 2})]
)
def test_only_the_chosen_classes_are_people(class_ids, expected):
    boxes = [
        {"id": str(k + 1), "results": [{"hypothesis": {"class_id": label}}]}
        for k, label in enumerate(("person", "chair"))
    ]
    raw = serialize(BOXES, {"header": header(10**9, "map"), "detections": boxes})
    follower = follower_of(people_type=BOXES, class_ids=class_ids)
    assert tracks_of(answered(follower, raw)) == expected
    assert follower.counts.others == 2 - len(expected)


def test_somebody_without_a_place_costs_nobody_else_the_frame(caplog):
    follower = follower_of()
    published = answered(follower, people(1.0, eve=(np.nan, 0.0), ben=(3.0, 1.0)))
    assert seen(published).keys() == {"ben"}
    assert follower.counts.without_forecast == 1
    assert caplog.records


def test_after_an_error_everything_goes_on():
    follower, plain = follower_of(), follower_of()
    answered(follower, people(1.0, anna=(0.0, 0.0)))
    for wrong in (b"", b"\0\1\0\0\xff\xff\xff\xff", people(1e9, anna=(0.0, 0.0))[:20]):
        with pytest.raises(ValueRuleError):
            answered(follower, wrong)
    assert follower.counts.refused == 3
    answered(plain, people(1.0, anna=(0.0, 0.0)))
    last = people(1.3, anna=(0.3, 0.0))
    found, expected = (rows_of(answered(one, last)["predictions"]) for one in (follower, plain))
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(("x", "is_rounded"), [(1e4, False), (4e5, True)])
def test_positions_that_a_table_cannot_hold_are_warned_about(x, is_rounded, caplog):
    answered(follower_of(), people(1.0, anna=(x, 0.0)))
    assert bool(caplog.records) == is_rounded


# Frames


def test_a_person_before_a_robot_that_drives_and_turns_stands():
    follower = follower_of()
    for k in range(25):
        at_s = 100.0 + k / 10
        move(follower, at_s, ("map", "base_link", robot(at_s)))
        eve = seen(answered(follower, people(at_s, "base_link", eve=from_robot(STANDING, at_s))))["eve"]
        assert np.hypot(*eve[1]) < 0.05
        np.testing.assert_allclose(eve[0], STANDING[:2], atol=0.05)


@pytest.mark.parametrize("identities", ["given", "assigned"])
@pytest.mark.parametrize(("jump_m", "jump_rad"), [(0.3, 0.0), (8.0, 2.0)])
def test_people_do_not_move_when_the_localisation_jumps(identities, jump_m, jump_rad, caplog):
    """Nor where wheels slip, so that the localisation moves slowly."""
    caplog.set_level("INFO", "pedpred.ros2.follower")
    follower = follower_of(identities=identities)
    for k in range(50):
        at_s = 100.0 + k / 10
        odom = Rotation.from_euler("z", jump_rad * (k > 25)), np.array([jump_m * (k > 25), 0.01 * k, 0.0])
        move(follower, at_s, ("odom", "base_link", robot(at_s)), ("map", "odom", odom))
        walking = np.array([8.0 - 0.1 * k, 3.0, 0.0])
        here = {"1": from_robot(STANDING, at_s), "2": from_robot(walking, at_s)}
        found = seen(answered(follower, people(at_s, "base_link", **here)))
        assert found.keys() == {"1", "2"}
        if k > 5:
            assert np.hypot(*found["1"][1]) < 0.15
            np.testing.assert_allclose(found["2"][1], odom[0].apply([-1.0, 0.0, 0.0])[:2], atol=0.2)
    assert sum(record.name == "pedpred.ros2.follower" for record in caplog.records) == 1


@pytest.mark.parametrize("behind_s", [0.0, 0.03, 0.2])
def test_a_second_camera_may_be_behind(behind_s):
    """People of both are forecast, with the latest stamp."""
    follower = follower_of()
    for k in range(40):
        at_s, late_s = 100.0 + 0.1 * k, 100.0 + 0.1 * k - behind_s
        move(follower, at_s, ("map", "odom", UNMOVED), ("odom", "base_link", robot(at_s)))
        answered(follower, people(at_s, "base_link", eve=from_robot(STANDING, at_s)))
        if k < 3:
            continue
        walking = np.array([8.0 - late_s + 100.0, 3.0, 0.0])
        published = answered(follower, people(late_s, "base_link", bob=from_robot(walking, late_s)))
        found = seen(published)
        assert found.keys() == {"eve", "bob"}
        if k > 10:
            speeds = [found["eve"][1][0], found["bob"][1][0]]
            np.testing.assert_allclose(speeds, [0.0, -1.0], atol=0.2)
        assert published["predictions"]["header"] == header(round(at_s * 1e9))
    assert follower.counts.left_out == 0


def test_people_wait_for_the_transform_of_their_time():
    """The wait is part of the latency, as is the time in the queue before."""
    follower = follower_of(transform_timeout_s=1.0)
    for at_s in (100.0, 100.1):
        move(follower, at_s, ("map", "base_link", robot(at_s)))
    raw = people(100.2, "base_link", eve=from_robot(STANDING, 100.2))
    follower.inbox.take_people(raw, 10**9, 5.0, 0.25)
    assert list(follower.outputs(5.0)) == []
    move(follower, 100.3, ("map", "base_link", robot(100.3)))
    published = contents(follower.outputs(5.5))
    np.testing.assert_allclose(seen(published)["eve"][0], STANDING[:2], atol=0.1)
    assert published["predictions"]["header"] == header(100_200_000_000)
    assert (follower.arrived_s, follower.forecast_s) == (4.75, 5.0)


def test_more_people_than_can_wait_still_have_forecasts():
    """Transforms are 4 s late at 30 Hz: the first messages stay in the queue."""
    follower, answers = follower_of(transform_timeout_s=6.0), []
    for k in range(360):
        at_s = 100.0 + k / 30
        if k >= 120:
            move(follower, at_s - 4.0, ("map", "base_link", robot(at_s - 4.0)))
        answers.append("predictions" in answered(follower, people(at_s, "base_link", eve=(1, 0)), k / 30))
    assert sum(answers[150:]) > 0.7 * len(answers[150:])


def test_people_who_wait_too_long_are_left_out(caplog):
    follower = follower_of(transform_timeout_s=0.2)
    for at_s in (100.0, 100.1):
        move(follower, at_s, ("odom", "base_link", robot(at_s)))
    answered(follower, people(100.5, "base_link", eve=(1.0, 0.0)))
    assert list(follower.outputs(0.1)) == []
    assert list(follower.outputs(0.3)) == []
    assert all(name in caplog.messages[-1] for name in ("'base_link'", "'odom'", "'map'"))
    move(follower, 100.0, ("map", "odom", UNMOVED), fixed=True)
    answered(follower, people(100.5, "base_link", eve=(1.0, 0.0)), 1.0)
    assert list(follower.outputs(1.3)) == []
    assert all(name in caplog.messages[-1] for name in ("'base_link'", "'odom'", "0.4 s"))
    assert follower.counts.lost == 2


def test_people_without_a_frame_are_left_out():
    follower = follower_of()
    assert answered(follower, people(1.1, "", anna=(1.0, 0.0))) == {}
    assert list(follower.outputs(1.0)) == []
    assert follower.counts.lost == 1


@pytest.mark.parametrize("ignore_m", [0.0, 0.3])
def test_detections_near_the_robot_can_be_ignored(ignore_m):
    follower = follower_of(ignore_near_robot_m=ignore_m)
    move(follower, 1.0, ("map", "base_link", (Rotation.identity(), np.array([5.0, 1.0, 0.0]))))
    names = seen(answered(follower, people(1.0, robot=(5.2, 1.0), eve=(5.4, 1.0)))).keys()
    assert names == ({"robot", "eve"} if ignore_m == 0.0 else {"eve"})
    assert follower.counts.near_robot == (ignore_m > 0.0)


# Time


def test_people_without_a_stamp_are_of_their_arrival():
    """Not of that at which they are read: people of a queue that is read at once would seem to run."""
    follower, speeds = follower_of(max_wait_s=2.0), []
    for k in range(20):
        waited_s = 0.1 * max(15 - k, 0) if k >= 5 else 0.0  # read when the fifteenth has come
        read_ns = round((50.0 + 0.1 * k + waited_s) * 1e9)
        follower.inbox.take_people(people(0.0, anna=(0.13 * k, 0.0)), read_ns, 0.0, waited_s)
        published = contents(follower.outputs(0.0))
        assert published["predictions"]["header"]["stamp"]["sec"] == 50 + k // 10
        speeds.append(seen(published)["anna"][1][0])
    np.testing.assert_allclose(speeds[6:], 1.3, atol=0.4)


def test_late_messages_are_left_out_until_the_rest_is_in_time():
    """Waits in a queue that fills, s, and whether each message is forecast."""
    follower = follower_of(max_wait_s=2.0)
    waits = {0.0: True, 1.9: True, 2.1: False, 1.0: False, 0.3: False, 0.1: True, 1.8: True}
    for k, (waited_s, is_forecast) in enumerate(waits.items()):
        follower.inbox.take_people(people(1.0 + k / 10), 0, 0.0, waited_s)
        assert bool(list(follower.outputs(0.0))) == is_forecast
    assert follower.counts.slow == 3


def test_outputs_are_emptied_once_people_have_gone():
    """Trackers may be silent when there are no people, or end; a simulation that pauses changes nothing."""
    follower = follower_of(occupancy_cell_m=0.5)
    assert list(follower.clear_outputs(10**12)) == []
    for k in range(5):
        clock_ns = 10**11 + k * 10**8
        assert answered(follower, people(5.0 + k / 10, **{"7": (2.0, 1.0)}), k / 10, clock_ns)
        assert list(follower.clear_outputs(clock_ns + 29 * 10**8)) == []
    published = contents(follower.clear_outputs(10**11 + 34 * 10**8))
    assert published.keys() == output_types(follower.settings, 10).keys() - {"predictions/names"}
    assert not published["predicted_occupancy/horizon"]["data"].any()
    assert len(published[MARKERS]["markers"]) == 1  # delete all
    assert (published["predictions"]["width"], follower.counts.people) == (0, 0)
    assert published["predictions"]["header"] == header(8_400_000_000)
    assert list(follower.clear_outputs(10**12)) == []  # once
    assert seen(answered(follower, people(6.0, **{"7": (2.0, 1.0)}))).keys() == {"7"}
    assert contents(follower.clear_outputs(10**9, 0.0)).keys() == published.keys()  # the node ends


@pytest.mark.parametrize("clock_s", [0, 2, 60, 104, 1000])
def test_empty_outputs_have_the_stamp_of_now(clock_s):
    """Wherever the clock has jumped since, as in a simulation that begins again; stamps are 3 s behind it."""
    follower = follower_of()
    assert answered(follower, people(97.0, anna=(1.0, 0.0)), 0.0, 100 * 10**9)
    published = contents(follower.clear_outputs(clock_s * 10**9))
    stamp = {"sec": max(clock_s - 3, 0), "nanosec": 0}  # none is before 0, which readers refuse
    assert published["predictions"]["header"]["stamp"] == stamp
    assert published[MARKERS]["markers"][0]["header"]["stamp"] == stamp


# Subscribers


def test_messages_without_subscribers_are_not_made():
    """But for the forecasts themselves: they are kept for later subscribers."""
    topics = set()
    follower = follower_of(topics.__contains__, occupancy_cell_m=0.5)
    assert answered(follower, people(5.0, **{"7": (2.0, 1.0)})).keys() == {"predictions"}
    topics |= {"predictions/people", "predicted_occupancy/step_3"}
    assert answered(follower, people(5.1, **{"7": (2.0, 1.1)})).keys() == {"predictions"} | topics


@pytest.mark.parametrize("end", ["no subscribers", "switched off"])
def test_no_latched_topic_keeps_people_who_are_gone(end):
    """Later subscribers are sent the last message, also of a topic that had no subscribers meanwhile."""
    topics = {*output_types(NodeSettings(occupancy_cell_m=0.5), 10)}
    follower = follower_of(topics.__contains__, occupancy_cell_m=0.5)
    last = answered(follower, people(5.0, **{"7": (20.0, 1.0)}))
    shown = last["predicted_occupancy/horizon"]
    assert shown["data"].any()
    if end == "no subscribers":
        topics.clear()
        last |= contents(follower.clear_outputs(10**9, 0.0))
    else:
        off = {"occupancy_cell_m": 0.0, "publish_markers": False, "publish_people": False}
        follower.settings = replace(follower.settings, **off)
        last |= answered(follower, people(5.1, **{"7": (20.0, 1.0)}))
        assert last["predictions"]["width"]
    assert last["predictions/people"]["people"] == []
    assert len(last[MARKERS]["markers"]) == 1  # delete all
    assert not any(last[topic]["data"].any() for topic in last if topic.startswith("predicted_occupancy"))
    assert last["predicted_occupancy/horizon"]["info"]["origin"] == shown["info"]["origin"]
    assert answered(follower, people(5.2)).keys() <= {"predictions", *topics}  # once


def test_that_all_have_gone_is_shown_at_once():
    follower, here = follower_of(occupancy_cell_m=0.5, max_age_s=0.0), {"7": (2.0, 1.0)}
    for at_s, places, shown in ((7.0, here, True), (7.02, {}, True), (7.04, {}, False), (7.06, here, False)):
        published = answered(follower, people(at_s, **places))
        assert (MARKERS in published, "predicted_occupancy/horizon" in published) == (shown, shown)


@pytest.mark.parametrize(("step_s", "least", "most"), [(0.02, 9, 13), (0.099, 50, 50)])
def test_markers_and_grids_come_no_more_often_than_viewers_need(step_s, least, most):
    """At 50 Hz, about every tenth of a second; at 10 Hz each time."""
    follower = follower_of(occupancy_cell_m=0.5)
    found = [answered(follower, people(5.0 + k * step_s, **{"7": (2.0, 1.0)})).keys() for k in range(50)]
    assert all({"predictions", "predictions/people"} <= topics for topics in found)
    for topic in (MARKERS, "predicted_occupancy/horizon"):
        assert least <= sum(topic in topics for topics in found) <= most


def test_viewers_and_costmaps_take_at_most_half_of_the_time():
    now_s = 0.0

    def slow(topic):
        nonlocal now_s
        now_s += 0.5 * (topic == MARKERS)  # as if markers took half a second
        return True

    follower, shown = follower_of(slow, lambda: now_s), []
    for k in range(20):
        shown.append(MARKERS in answered(follower, people(5.0 + k / 10, **{"7": (2.0, 1.0)})))
        now_s += 0.125
    assert shown == ([True] + 3 * [False]) * 5


@pytest.mark.parametrize("other", ["", str(2**32 + 1)])
def test_viewers_keep_the_markers_of_all_people(other):
    """They keep one marker of each namespace and number, and numbers of markers have 32 bits."""
    follower = follower_of()
    for k in range(2):
        published = answered(follower, people(5.0 + k / 10, **{"1": (0.0, 0.0), other: (3.0, 1.0)}))
    markers = published[MARKERS]["markers"][1:]
    assert len({(one["ns"], one["id"]) for one in markers}) == len(markers) > 0
    assert sum(one["ns"] == "names" for one in markers) == 2


# Identities


@pytest.mark.parametrize("name", ["", "nan", "-1"])
def test_people_without_an_id_are_followed_by_position(name, caplog):
    """As in bags."""
    follower = follower_of()
    for k in range(20):
        here = [("eve", (0.0, 0.0)), (name, (4.0 + 0.1 * k, 3.0)), (name, (9.0, 9.0 - 0.1 * k))]
        found = seen(answered(follower, crowd(1.0 + k / 10, here[:: 1 - 2 * (k % 2)])))
    assert found.keys() == {"#1", "#2", "eve"}
    assert sorted(round(vx - vy) for _, (vx, vy) in found.values()) == [0, 1, 1]
    assert caplog.records


@pytest.mark.parametrize("first", [0, 12])
def test_people_whose_ids_come_and_go_do_not_seem_to_move(first):
    """Numbers of people that are identified by position are not those of ids."""
    follower = follower_of()
    for k in range(60):
        names = ("", "") if (k + first) // 12 % 2 else ("2", "1")
        here = list(zip(names, [(0.0, 0.8), (0.0, 0.0)], strict=True))
        found = seen(answered(follower, crowd(1.0 + k / 10, here[:: 1 - 2 * (k % 2)])))
        assert np.abs([velocity for _, velocity in found.values()]).max() < 0.01


# Maps and grids


def test_the_grid_for_a_costmap_has_the_bytes_of_its_type():
    """CDR of nav_msgs/OccupancyGrid: per cent row by row along x, in the frame and with the stamp of now."""
    path = np.array([[[0.5, 0.5]], [[2.5, 1.5]]])
    spread = np.full((2, 1, 1, 2, 2), 1e-6) * np.eye(2)
    forecasts = Predictions(path, path[:, None], np.ones((2, 1)), 0.3, spread)
    ground = OccupancyMap(np.zeros((3, 2), bool), np.zeros(2), 1.0)
    content = grid_messages(forecasts, ground, 7_000_000_003, "map", horizon=True)[HORIZON]
    cells = bytes(np.asarray(content["data"], np.int8).tolist())
    expected = b"\0\1\0\0" + struct.pack("<iII", 7, 3, 4) + b"map\0"
    expected += struct.pack("<iIfII", 7, 3, 1.0, 3, 2)
    expected += b"\0" * (-(len(expected) - 4) % 8)
    expected += struct.pack("<7d", 0, 0, 0, 0, 0, 0, 1) + struct.pack("<I", 6) + cells
    assert serialize(GRID, content) == expected
    shares = np.frombuffer(cells, np.int8).reshape(2, 3)
    assert min(shares[0, 0], shares[1, 2]) > max(shares[0, 1], shares[0, 2], shares[1, 0], shares[1, 1])


def test_without_a_map_there_are_no_grids(caplog):
    follower = follower_of()
    follower.settings = replace(follower.settings, occupancy_cell_m=0.5)
    topics = answered(follower, people(1.0, eve=(1.0, 1.0))).keys()
    assert MARKERS in topics
    assert not any(topic.startswith("predicted_occupancy") for topic in topics)
    assert caplog.records


@pytest.mark.parametrize("cell_m", [0.02, 0.1, 0.5])
def test_grids_cover_the_map_in_cells_of_at_least_0_1_m(cell_m):
    follower = follower_of(occupancy_cell_m=cell_m)
    info = answered(follower, people(1.0, eve=(1.0, 1.0)))["predicted_occupancy/horizon"]["info"]
    assert info["resolution"] == max(cell_m, 0.1)
    assert info["width"] * info["resolution"] == pytest.approx(60.0)


_FIRST_MESSAGE = """
import time
from pedpred import OnlinePredictor, warm_up
from pedpred.ros.message_types import serialize
from pedpred.ros2.follower import Follower
from pedpred.ros2.rehearsal import rehearse
from pedpred.ros2.settings import NodeSettings
warm_up()
settings = NodeSettings(use_map=False)
predictor = OnlinePredictor.load(None, settings.online())
begun_s = time.process_time()
rehearse(predictor, settings)
rehearsed_s = time.process_time() - begun_s
people = serialize(settings.people_type, {"header": {"frame_id": "map"}, "people": [{"name": "7"}]})
begun_s = time.process_time()
follower = Follower(predictor, settings)
follower.inbox.take_people(people, 10**9, 0.0)
outputs = [serialize(output.kind, output.content) for output in follower.outputs(0.0)]
assert len(outputs) == 3, len(outputs)
taken_s = time.process_time() - begun_s
assert taken_s < rehearsed_s / 3, (taken_s, rehearsed_s)
"""


def test_the_first_people_do_not_wait_for_what_is_done_once():
    """Types of messages are read and written for the first time before the node subscribes to people."""
    command = [sys.executable, "-c", _FIRST_MESSAGE]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
