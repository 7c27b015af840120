"""What the ROS node does between messages: bytes as they are on the wire in, contents of messages out."""

import struct
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pedpred.errors import ValueRuleError
from pedpred.online import OnlinePredictor
from pedpred.ros.message_types import UPDATE_TYPE, known_types, serialize
from pedpred.ros.people import PEOPLE_FIELDS
from pedpred.ros.planning import HORIZON, grid_messages
from pedpred.ros.scene_messages import header, map_message
from pedpred.ros2.counts import Counts
from pedpred.ros2.diagnostics import DIAGNOSTICS_TYPE, Latencies, diagnose, diagnostics_content, status_values
from pedpred.ros2.follower import Follower
from pedpred.ros2.log import guarded
from pedpred.ros2.outputs import MARKERS, output_types
from pedpred.ros2.settings import LIVE, NodeSettings, described, fields_of, unchangeable
from pedpred.ros2.wire import decode
from pedpred.scenes import OccupancyMap, Predictions
from tests.bags import GRID, PEOPLE
from tests.following import answered, follower_of, grid, people, ready, rows_of, transform, transforms
from tests.robots import STANDING, from_robot, robot

BOXES = "vision_msgs/msg/Detection3DArray"
AGENTS = "pedsim_msgs/msg/AgentStates"
NOWHERE = np.array([np.nan, 0.0, 0.0])


def test_every_answer_is_a_message_of_its_type():
    follower = follower_of(occupancy_cell_m=0.5)
    answers = answered(follower, people(5.0, anna=(0.0, 0.0), **{"7": (2.0, 1.0)}))
    types = output_types(follower.settings, 10)
    assert answers.keys() == types.keys()
    for topic, content in answers.items():
        known_types().deserialize_cdr(serialize(types[topic], content), types[topic])
    names = [person["name"] for person in answers["predictions/people"]["people"]]
    assert names == ["anna", "7"]
    assert answered(follower, people(4.8, anna=(0.0, 0.0))) == {}  # late
    assert follower.counts.late == 1


def test_who_stands_has_no_speed_seen_from_a_robot_that_drives_and_turns():
    follower = follower_of()
    for k in range(25):
        at_s = 100.0 + k / 10
        follower.transforms_came(transforms(transform("map", "base_link", *robot(at_s), at_s)), at_s, False)
        answers = answered(follower, people(at_s, "base_link", eve=from_robot(STANDING, at_s)))
        (eve,) = answers["predictions/people"]["people"]
        assert np.hypot(*eve["velocity"].values()) < 0.05
        np.testing.assert_allclose(list(eve["position"].values()), STANDING[:2], atol=0.05)


@pytest.mark.parametrize("identities", ["given", "assigned"])
@pytest.mark.parametrize(("jump_m", "jump_rad"), [(0.3, 0.0), (1.0, 0.1), (8.0, 2.0)])
def test_nobody_moves_because_the_localisation_jumps(identities, jump_m, jump_rad, caplog):
    """Where it lies on the map, not who is there, is what a robot has learned. With wheels that slip, too."""
    caplog.set_level("INFO")
    follower = follower_of(identities=identities)
    for k in range(50):
        at_s = 100.0 + k / 10
        lies = Rotation.from_euler("z", jump_rad * (k > 25)), np.array([jump_m * (k > 25), 0.01 * k, 0.0])
        moved = transforms(
            transform("odom", "base_link", *robot(at_s), at_s), transform("map", "odom", *lies, at_s)
        )
        follower.transforms_came(moved, at_s, False)
        walking = np.array([8.0 - 0.1 * k, 3.0, 0.0])
        places = {"1": from_robot(STANDING, at_s), "2": from_robot(walking, at_s)}
        answers = answered(follower, people(at_s, "base_link", **places))
        eve, bob = answers["predictions/people"]["people"]
        assert (eve["name"], bob["name"]) == ("1", "2")
        if k > 5:
            assert np.hypot(*eve["velocity"].values()) < 0.15
            velocity = lies[0].apply([-1.0, 0.0, 0.0])[:2]
            np.testing.assert_allclose([*bob["velocity"].values()][:2], velocity, atol=0.2)
    assert sum(record.funcName == "_follow_localisation" for record in caplog.records) == 1


def test_a_localisation_that_jumps_at_every_message_costs_nobody_the_id(caplog):
    """As where two localisations publish where the odometry is."""
    follower = follower_of()
    for k in range(40):
        at_s, shift = 100.0 + 0.1 * k, np.array([3.0 * (k % 2), 0.0, 0.0])
        poses = (
            transform("odom", "base_link", *robot(at_s), at_s),
            transform("map", "odom", robot(0)[0], shift, at_s),
        )
        follower.transforms_came(transforms(*poses), at_s, False)
        answers = answered(follower, people(at_s, "base_link", eve=from_robot(STANDING, at_s)))
        (eve,) = answers["predictions/people"]["people"]
        assert eve["name"] == "eve"
    assert "ids do not stay" not in caplog.text


def test_diagnostics_say_that_the_map_does_not_lie_under_people():
    follower = follower_of(use_map=True)
    follower.map_came(grid(np.zeros((20, 20)), position={"x": 5000.0, "y": 5000.0}))
    for k in range(40):
        answered(
            follower, people(100.0 + 0.1 * k, **{str(n): (0.12 * k, 3.0 * n) for n in range(3)}), 0.1 * k
        )
    level, summary = diagnose(follower, 4.0, 1, Counts())
    assert level == 1
    assert "outside the map" in summary


@pytest.mark.parametrize("behind_s", [0.0, 0.03, 0.2])
def test_people_of_a_second_camera_are_forecast_whichever_stamps_come_first(behind_s):
    """The table has the stamp of its forecasts."""
    follower = follower_of()
    for k in range(40):
        at_s, late_s = 100.0 + 0.1 * k, 100.0 + 0.1 * k - behind_s
        pose = (
            transform("map", "odom", Rotation.identity(), np.zeros(3), at_s),
            transform("odom", "base_link", *robot(at_s), at_s),
        )
        follower.transforms_came(transforms(*pose), at_s, False)
        answered(follower, people(at_s, "base_link", eve=from_robot(STANDING, at_s)))
        if k < 3:
            continue
        walking = np.array([8.0 - late_s + 100.0, 3.0, 0.0])
        answers = answered(follower, people(late_s, "base_link", bob=from_robot(walking, late_s)))
        told = {one["name"]: one["velocity"]["x"] for one in answers["predictions/people"]["people"]}
        assert told.keys() == {"eve", "bob"}
        if k > 10:
            np.testing.assert_allclose([told["eve"], told["bob"]], [0.0, -1.0], atol=0.2)
        assert answers["predictions"]["header"] == header(round(at_s * 1e9))
    assert follower.counts.left_out == 0


def test_places_that_a_table_cannot_hold_are_told(caplog):
    for x in (1e4, 4e5):
        assert "rounded" not in caplog.text
        answered(follower_of(), people(1.0, anna=(x, 0.0)))
    assert "places in /predictions are rounded to 0.03" in caplog.text


def test_people_wait_for_the_transform_of_their_time():
    follower = follower_of(transform_timeout_s=0.2)
    follower.transforms_came(transforms(transform("map", "base_link", *robot(100.0), 100.0)), 100.0, False)
    follower.transforms_came(transforms(transform("map", "base_link", *robot(100.1), 100.1)), 100.1, False)
    assert answered(follower, people(100.2, "base_link", eve=from_robot(STANDING, 100.2)), 0.0) == {}
    follower.transforms_came(transforms(transform("map", "base_link", *robot(100.3), 100.3)), 100.3, False)
    (first, *_) = follower.answers(0.1)
    x, y = rows_of(first.content)[["x", "y"]][0]
    assert np.hypot(x - 3.0, y - 2.0) < 0.1
    assert (first.content["header"]["stamp"], first.content["header"]["frame_id"]) == (
        {"sec": 100, "nanosec": 200_000_000},
        "map",
    )


def test_people_are_forecast_however_late_their_transforms_come_within_the_time_given():
    """Here 4 s at 30 Hz, more messages than wait at once; where more come, the first ones have their turn."""
    follower, told = follower_of(transform_timeout_s=6.0), []
    for k in range(360):
        at_s = 100.0 + k / 30
        if at_s > 104.0:
            raw = transforms(transform("map", "base_link", *robot(at_s - 4.0), at_s - 4.0))
            follower.transforms_came(raw, at_s, False)
        told.append("predictions" in answered(follower, people(at_s, "base_link", eve=(1.0, 0.0)), k / 30))
    assert sum(told[150:]) > 0.7 * len(told[150:])


def test_people_before_the_first_transform_do_not_hold_up_later_ones():
    follower, heard = follower_of(transform_timeout_s=60.0), []
    for k in range(20):
        at_s = 100.0 + k / 10
        if k >= 5:
            follower.transforms_came(
                transforms(transform("map", "base_link", *robot(at_s), at_s)), at_s, False
            )
        heard.append("predictions" in answered(follower, people(at_s, "base_link", eve=(1.0, 0.0)), k / 10))
    assert heard == [False] * 5 + [True] * 15
    assert follower.counts.lost == 5


def test_the_wait_for_a_transform_is_part_of_the_latency():
    """As is the time in the queue before."""
    follower = follower_of(transform_timeout_s=1.0)
    follower.people_came(people(100.0, "odom", eve=(0.0, 0.0)), 10**9, 5.0, 0.25)
    assert list(follower.answers(5.0)) == []
    fixed = Rotation.identity(), (0.0, 0.0, 0.0)
    follower.transforms_came(transforms(transform("map", "odom", *fixed, 100.0)), 100.0, False)
    assert next(follower.answers(5.5)).topic == "predictions"
    assert (follower.arrived_s, follower.forecast_s) == (4.75, 5.0)


def test_people_without_a_stamp_are_of_the_time_when_they_came_however_long_nobody_read_them():
    """Else people of a queue that is read at once seem to run."""
    follower, xs = follower_of(max_wait_s=2.0), []
    for k in range(20):
        waited_s = 0.1 * max(15 - k, 0) if k >= 5 else 0.0  # read when the fifteenth has come
        read_ns = round((50.0 + 0.1 * k + waited_s) * 1e9)
        follower.people_came(people(0.0, anna=(0.13 * k, 0.0)), read_ns, 0.0, waited_s)
        answers = {answer.topic: answer.content for answer in follower.answers(0.0)}
        assert answers["predictions"]["header"]["stamp"]["sec"] == 50 + k // 10
        xs.append(answers["predictions/people"]["people"][0]["velocity"]["x"])
    assert np.all(np.abs(np.array(xs[6:]) - 1.3) < 0.4)


def test_who_waits_in_vain_is_left_out_and_the_log_says_what_is_missing(caplog):
    follower = follower_of(transform_timeout_s=0.2)
    for at_s in (100.0, 100.1):
        raw = transforms(transform("odom", "base_link", *robot(at_s), at_s))
        follower.transforms_came(raw, at_s, False)
    answered(follower, people(100.5, "base_link", eve=(1.0, 0.0)))
    assert list(follower.answers(0.1)) == []
    assert list(follower.answers(0.3)) == []
    assert "'base_link' ends at 'odom' and 'map' has no parent" in caplog.text
    still = Rotation.identity(), np.zeros(3)
    follower.transforms_came(transforms(transform("map", "odom", *still)), 100.0, True)
    answered(follower, people(100.5, "base_link", eve=(1.0, 0.0)), 1.0)
    assert list(follower.answers(1.3)) == []
    assert "the transform of 'base_link' in 'odom' is 0.4 s older than the people" in caplog.text
    assert follower.counts.lost == 2


def test_somebody_without_a_place_costs_nobody_else_the_frame(caplog):
    follower = follower_of()
    answers = answered(follower, people(1.0, eve=(np.nan, 0.0), ben=(3.0, 1.0)))
    assert [person["name"] for person in answers["predictions/people"]["people"]] == ["ben"]
    assert status_values(follower, Latencies())["left out: people without a forecast"] == 1
    answered(follower, people(1.1, eve=(1.0, 0.0), ben=(3.0, 1.0)))
    answered(follower, people(1.2, eve=(np.nan, 0.0), ben=(3.0, 1.0)))  # she was seen just before
    assert follower.counts.without_forecast == 1


def test_only_the_wanted_classes_are_people():
    def box(name, kind, x):
        pose = {"position": {"x": x}, "orientation": {"w": 1.0}}
        results = [{"hypothesis": {"class_id": kind, "score": 0.9}}]
        return {"id": name, "results": results, "bbox": {"center": pose}}

    boxes = [box("1", "person", 0.0), box("2", "chair", 2.0)]
    raw = serialize(BOXES, {"header": header(10**9, "map"), "detections": boxes})
    for class_ids, expected in ((("person",), {1}), (("chair", "person"), {1, 2}), (("",), {1, 2})):
        follower = follower_of(people_type=BOXES, class_ids=class_ids)
        assert set(rows_of(answered(follower, raw)["predictions"])["track_id"]) == expected
        told = status_values(follower, Latencies())["left out: detections of other classes"]
        assert told == 2 - len(expected)
        assert diagnose(follower, 0.0, 1, Counts())[0] == 0


def test_diagnostics_say_that_nobody_is_of_a_wanted_class():
    """As where a detector calls people 0; somebody who is makes it well."""
    follower = follower_of(people_type=BOXES)
    for k, (kind, level) in enumerate((("0", 1), ("person", 0), ("0", 0))):
        pose = {"orientation": {"w": 1.0}}
        box = {"id": "1", "results": [{"hypothesis": {"class_id": kind}}], "bbox": {"center": pose}}
        stamp = header(10**9 + k * 10**8, "map")
        answered(follower, serialize(BOXES, {"header": stamp, "detections": [box]}))
        found, text = diagnose(follower, 0.0, 1, Counts())
        assert (found, "class_ids" in text) == (level, bool(level))


def test_diagnostics_say_that_a_simulated_clock_stands_and_not_that_stamps_are_wrong():
    """Then nothing says that people have gone."""
    follower = follower_of()
    follower.people_came(people(50.0, anna=(0.0, 0.0)), 0, 0.0)
    list(follower.answers(0.0))
    level, text = diagnose(follower, 0.0, 1, Counts(), clock_ns=0)
    assert (level, "use_sim_time" in text, "ago" in text) == (1, True, False)


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
follower.people_came(people, 10**9, 0.0)
answers = [serialize(answer.kind, answer.content) for answer in follower.answers(0.0)]
assert len(answers) == 3, len(answers)
taken_s = time.process_time() - begun_s
assert taken_s < rehearsed_s / 3, (taken_s, rehearsed_s)
"""


def test_the_first_people_do_not_wait_for_what_is_done_once():
    """Types of messages are read and written for the first time before the node listens to people."""
    command = [sys.executable, "-c", _FIRST_MESSAGE]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_nobody_is_an_answer_too(caplog):
    """An empty message is answered on every topic, in every frame, and warns of nothing."""
    for kind, frame in ((PEOPLE, "map"), (PEOPLE, "camera"), ("geometry_msgs/msg/PoseArray", "map")):
        follower = follower_of(use_map=True, people_type=kind, occupancy_cell_m=0.5)
        answers = answered(follower, serialize(kind, {"header": header(10**9, frame)}))
        assert answers.keys() == output_types(follower.settings, 10).keys() - {"predictions/names"}
        assert answers["predictions"]["width"] == 0
    assert "no map" not in caplog.text


def test_the_robot_of_a_simulator_is_nobody():
    agents = [
        {"id": 3, "type": 1, "pose": {"position": {"x": 1.0}}},
        {"id": 4, "type": 2, "pose": {"position": {"x": 5.0}}},
    ]
    raw = serialize(AGENTS, {"header": header(10**9, "map"), "agent_states": agents})
    answers = answered(follower_of(people_type=AGENTS), raw)
    assert set(rows_of(answers["predictions"])["track_id"]) == {3}


def test_a_map_in_another_frame_begins_anew_and_the_same_map_changes_nothing(caplog):
    follower = follower_of(use_map=True)
    answered(follower, people(1.0, anna=(1.0, 0.0)))
    assert "use_map" in caplog.text
    assert diagnose(follower, 0.0, 1, Counts()) == (1, "no map: forecasts go through walls")
    content = map_message(OccupancyMap(np.ones((4, 5), bool), np.zeros(2), 0.5), 0)
    content["header"]["frame_id"] = "world"
    for _ in range(2):
        follower.map_came(serialize(GRID, content))
    assert sum(record.funcName == "map_came" for record in caplog.records) == 1
    answers = answered(follower, people(1.1, "world", anna=(1.0, 0.0)))
    assert answers["predictions"]["header"]["frame_id"] == "world"
    assert diagnose(follower, 0.0, 1, Counts()) == (0, "forecasts with map")
    assert diagnose(follower, 9.0, 1, Counts()) == (1, "no people received")
    assert diagnose(follower, 9.0, 1, Counts(), [PEOPLE]) == (1, "no people received")
    _, text = diagnose(follower, 9.0, 2, Counts(), [PEOPLE, BOXES])
    assert text == f"no people received: {BOXES} is published, people_type is {PEOPLE}"
    values = status_values(follower, Latencies())
    told = serialize(DIAGNOSTICS_TYPE, diagnostics_content("pedpred", 1, "x", values, 5))
    (status,) = known_types().deserialize_cdr(told, DIAGNOSTICS_TYPE).status
    assert {pair.key: pair.value for pair in status.values}["map"] == "4 x 5 cells, 100.0 % blocked"


def test_a_map_without_a_frame_silences_nobody(caplog):
    """It is where forecasts are; people without one are left out, since they may be in a sensor's."""
    follower = follower_of(use_map=True, map_frame="/hall")
    content = map_message(OccupancyMap(np.ones((4, 5), bool), np.zeros(2), 0.5), 0)
    content["header"]["frame_id"] = ""
    follower.map_came(serialize(GRID, content))
    answers = answered(follower, people(1.0, "hall", anna=(1.0, 0.0)))
    assert answers["predictions"]["header"]["frame_id"] == "hall"
    assert follower.occupancy is not None
    assert "header.frame_id" in caplog.text
    assert answered(follower, people(1.1, "", anna=(1.0, 0.0))) == {}
    assert list(follower.answers(1.0)) == []
    assert "people in '' left out: they name no frame (header.frame_id)" in caplog.text
    for name in ("", "/"):
        with pytest.raises(ValueRuleError, match="map_frame"):
            NodeSettings(map_frame=name)


@pytest.mark.parametrize("yaw_rad", [0.0, 0.5])
def test_an_update_changes_its_cells_of_the_map_and_no_others(yaw_rad):
    """As if the map had come whole, also where it is turned; one that does not fit changes nothing."""
    cells = np.zeros((6, 8), np.int8)

    def update(x, y, values, frame="map"):
        sizes = {"x": x, "y": y, "width": values.shape[1], "height": values.shape[0]}
        return serialize(UPDATE_TYPE, {"header": header(0, frame), "data": values.ravel(), **sizes})

    part, follower, plain = (
        np.full((2, 3), 100, np.int8),
        follower_of(use_map=True),
        follower_of(use_map=True),
    )
    follower.map_update_came(update(0, 0, part))
    assert follower.occupancy is None
    follower.map_came(grid(cells, yaw_rad))
    follower.map_update_came(update(4, 1, part))
    cells[1:3, 4:7] = 100
    plain.map_came(grid(cells, yaw_rad))
    np.testing.assert_array_equal(follower.occupancy.occupied, plain.occupancy.occupied)
    wrong = update(6, 1, part), update(0, 5, part), update(-1, 0, part), update(0, 0, part, "odom")
    for odd in (*wrong, update(0, 0, 0 * part - 100)):
        with pytest.raises(ValueRuleError, match=r"map|cells are -1"):
            follower.map_update_came(odd)
    np.testing.assert_array_equal(follower.occupancy.occupied, plain.occupancy.occupied)
    before = follower.occupancy
    follower.map_update_came(update(4, 1, part - 1))
    assert follower.occupancy is before  # what blocks is the same
    follower.map_came(grid(0 * cells, yaw_rad))  # the same bytes as at first
    assert not follower.occupancy.occupied.any()


@given(st.lists(st.sampled_from(["free", "blocked", "update"]), max_size=8))
@settings(max_examples=15, deadline=None)
def test_a_map_that_comes_twice_is_one_map(events):
    """A latched publisher is heard by two subscriptions, and other messages may come between the copies."""
    doubled, plain = follower_of(use_map=True), follower_of(use_map=True)
    maps = {
        name: serialize(GRID, map_message(OccupancyMap(np.full((4, 5), full), np.zeros(2), 0.5), 0))
        for name, full in (("free", False), ("blocked", True))
    }
    sizes = {"x": 1, "y": 1, "width": 2, "height": 1}
    update = serialize(UPDATE_TYPE, {"header": header(0, "map"), "data": np.int8([100, 0]), **sizes})
    for sent_ns, event in enumerate(("free", *events), start=1):
        if event != "update":
            last = maps[event], sent_ns
        for follower in (doubled, plain):
            follower.map_update_came(update) if event == "update" else follower.map_came(*last)
        doubled.map_came(*last)
        np.testing.assert_array_equal(doubled.occupancy.occupied, plain.occupancy.occupied)


def test_a_frame_of_the_robot_is_none_for_forecasts():
    follower = follower_of(map_frame="robot1/base_link")
    answered(follower, people(1.0, "robot1/base_link", anna=(1.0, 0.0)))
    assert "'robot1/base_link', which moves with the robot" in diagnose(follower, 0.0, 1, Counts())[1]


def test_people_without_ids_are_refused_where_ids_are_asked_for():
    nameless = people(1.0, **{"": (0.0, 0.0)})
    with pytest.raises(ValueRuleError):
        answered(follower_of(identities="given"), nameless)
    assert answered(follower_of(), nameless)


def test_the_grid_for_a_costmap_has_the_bytes_that_a_static_layer_reads():
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


def test_parameters_are_explained_and_checked():
    text = described()
    for name, _, meaning in fields_of(NodeSettings):
        assert f"{name} (" in text
        assert meaning
    assert {"transform_timeout_s", "occupancy_cell_m"} <= LIVE
    for wrong in ({"people_type": "x"}, {"identities": "x"}, {"max_age_s": -1.0}, {"use_map": 1}):
        with pytest.raises(ValueRuleError):
            NodeSettings(**wrong)


def test_the_same_value_again_is_no_change():
    """`ros2 param load` sets all parameters of a file, in whatever state the node is."""
    used = NodeSettings(max_age_s=1.0)
    again = {name: getattr(used, name) for name, *_ in fields_of(NodeSettings)}
    again |= {"class_ids": list(used.class_ids), "occupancy_cell_m": 0.5}
    assert unchangeable(again, used) == []
    other = {"max_age_s": 0.5, "class_ids": ["dog"], "use_map": False, "publish_markers": False}
    assert unchangeable(again | other, used) == ["class_ids", "max_age_s", "use_map"]


def test_what_nobody_listens_to_is_not_made():
    """But for the forecasts themselves: they are kept for whoever comes later."""
    heard = set()
    settings = NodeSettings(use_map=False, occupancy_cell_m=0.5)
    follower = ready(Follower(OnlinePredictor.load(), settings, heard.__contains__))
    assert answered(follower, people(5.0, **{"7": (2.0, 1.0)})).keys() == {"predictions"}
    heard |= {"predictions/people", "predicted_occupancy/step_3"}
    assert answered(follower, people(5.1, **{"7": (2.0, 1.1)})).keys() == {"predictions"} | heard


def test_who_is_not_heard_of_any_more_stays_in_no_costmap():
    """A tracker may say nothing when nobody is there, or end; a simulation that pauses changes nothing."""
    follower = follower_of(occupancy_cell_m=0.5)
    assert list(follower.cleared(10**12)) == []
    for k in range(5):
        follower.people_came(people(5.0 + k / 10, **{"7": (2.0, 1.0)}), 10**11 + k * 10**8, k / 10)
        assert list(follower.answers(k / 10))
        assert list(follower.cleared(10**11 + k * 10**8 + 29 * 10**8)) == []
    told = {answer.topic: answer.content for answer in follower.cleared(10**11 + 34 * 10**8)}
    assert told.keys() == output_types(follower.settings, 10).keys() - {"predictions/names"}
    assert not told["predicted_occupancy/horizon"]["data"].any()
    assert len(told["predictions/markers"]["markers"]) == 1  # delete all
    assert (told["predictions"]["width"], follower.counts.people) == (0, 0)
    assert told["predictions"]["header"]["stamp"] == {"sec": 8, "nanosec": 400_000_000}
    assert list(follower.cleared(10**12)) == []  # once
    (person,) = answered(follower, people(6.0, **{"7": (2.0, 1.0)}))["predictions/people"]["people"]
    assert person["name"] == "7"
    assert {answer.topic for answer in follower.cleared(10**9, 0.0)} == told.keys()  # the node ends


@pytest.mark.parametrize("clock_s", [0, 2, 60, 104, 1000])
def test_that_nobody_is_there_is_stamped_with_the_time_at_which_it_is_said(clock_s):
    """Wherever the clock has jumped since, as in a simulation that begins again; stamps are 3 s behind it."""
    follower = follower_of()
    follower.people_came(people(97.0, anna=(1.0, 0.0)), 100 * 10**9, 0.0)
    assert list(follower.answers(0.0))
    told = {answer.topic: answer.content for answer in follower.cleared(clock_s * 10**9)}
    said = {"sec": max(clock_s - 3, 0), "nanosec": 0}  # none is before 0, which readers refuse
    assert told["predictions"]["header"]["stamp"] == told[MARKERS]["markers"][0]["header"]["stamp"] == said


@pytest.mark.parametrize("end", ["unheard", "switched off"])
def test_no_latched_topic_keeps_people_who_are_gone(end):
    """Whoever subscribes later is sent the last message, also of a topic that nobody heard meanwhile."""
    heard, last = {*output_types(NodeSettings(occupancy_cell_m=0.5), 10)}, {}
    online = NodeSettings(use_map=False, occupancy_cell_m=0.5)
    follower = ready(Follower(OnlinePredictor.load(), online, heard.__contains__, clock=lambda: 0.0))
    last |= answered(follower, people(5.0, **{"7": (20.0, 1.0)}))
    shown = last["predicted_occupancy/horizon"]
    assert shown["data"].any()
    if end == "unheard":
        heard.clear()
        last |= {answer.topic: answer.content for answer in follower.cleared(10**9, 0.0)}
    else:
        off = {"occupancy_cell_m": 0.0, "publish_markers": False, "publish_people": False}
        follower.settings = replace(follower.settings, **off)
        last |= answered(follower, people(5.1, **{"7": (20.0, 1.0)}))
        assert last["predictions"]["width"]
    assert last["predictions/people"]["people"] == []
    assert len(last["predictions/markers"]["markers"]) == 1  # delete all
    assert not any(last[topic]["data"].any() for topic in last if topic.startswith("predicted_occupancy"))
    assert last["predicted_occupancy/horizon"]["info"]["origin"] == shown["info"]["origin"]
    assert answered(follower, people(5.2)).keys() <= {"predictions", *heard}  # once


def test_that_all_have_gone_is_shown_at_once():
    follower, here = follower_of(occupancy_cell_m=0.5, max_age_s=0.0), {"7": (2.0, 1.0)}
    for at_s, places, shown in ((7.0, here, True), (7.02, {}, True), (7.04, {}, False), (7.06, here, False)):
        answers = answered(follower, people(at_s, **places))
        assert (MARKERS in answers, "predicted_occupancy/horizon" in answers) == (shown, shown)


def test_markers_and_grids_are_made_no_more_often_than_viewers_need():
    """At 50 Hz, about every tenth of a second; at 10 Hz with shaking stamps, each time."""
    follower = follower_of(occupancy_cell_m=0.5)
    for first_s, step_s, least, most in ((5.0, 0.02, 9, 13), (20.0, 0.099, 50, 50)):
        shown = [
            answered(follower, people(first_s + k * step_s, **{"7": (2.0, 1.0)})).keys() for k in range(50)
        ]
        assert all({"predictions", "predictions/people"} <= own for own in shown)
        for topic in ("predictions/markers", "predicted_occupancy/horizon"):
            assert least <= sum(topic in own for own in shown) <= most


def test_viewers_and_costmaps_take_at_most_half_of_the_time():
    now_s = 0.0

    def slow(topic):
        nonlocal now_s
        now_s += 0.5 * (topic == MARKERS)  # as if markers took half a second
        return True

    online = NodeSettings(use_map=False)
    follower = Follower(OnlinePredictor.load(None, online.online()), online, slow, lambda: now_s)
    shown = []
    for k in range(20):
        shown.append(MARKERS in answered(follower, people(5.0 + k / 10, **{"7": (2.0, 1.0)})))
        now_s += 0.125
    assert shown == ([True] + 3 * [False]) * 5


def position(x):
    return {"position": {"x": x, "y": 1.0}, "orientation": {"w": 1.0}}


def persons(xs):
    """Fields of one message of each type, of people at some places; without header."""
    likely = [{"hypothesis": {"class_id": "person", "score": 0.9}}]
    return {
        PEOPLE: {"people": [{"name": str(k), "position": position(x)["position"]} for k, x in enumerate(xs)]},
        "people_msgs/msg/PositionMeasurementArray": {
            "people": [{"object_id": str(k), "pos": position(x)["position"]} for k, x in enumerate(xs)]
        },
        "spencer_tracking_msgs/msg/TrackedPersons": {
            "tracks": [{"track_id": k, "pose": {"pose": position(x)}} for k, x in enumerate(xs)]
        },
        "hunav_msgs/msg/Agents": {
            "agents": [{"id": k, "type": 1, "position": position(x)} for k, x in enumerate(xs)]
        },
        AGENTS: {"agent_states": [{"id": k, "type": 1, "pose": position(x)} for k, x in enumerate(xs)]},
        BOXES: {
            "detections": [
                {"id": str(k), "results": likely, "bbox": {"center": position(x)}} for k, x in enumerate(xs)
            ]
        },
        "geometry_msgs/msg/PoseArray": {"poses": [position(x) for x in xs]},
        "leg_tracker/msg/PersonArray": {"people": [{"id": k, "pose": position(x)} for k, x in enumerate(xs)]},
        "nav2_dynamic_msgs/msg/ObstacleArray": {
            "obstacles": [
                {"uuid": {"uuid": [k] * 16}, "position": position(x)["position"]} for k, x in enumerate(xs)
            ]
        },
        "zed_msgs/msg/ObjectsStamped": {
            "objects": [
                {"label": "person", "label_id": k, "position": [x, 1.0, 0.0]} for k, x in enumerate(xs)
            ]
        },
    }


@pytest.mark.parametrize("kind", sorted(PEOPLE_FIELDS))
def test_people_of_every_type_are_followed(kind, caplog):
    """Two people who walk; types without ids that last get them from the nearest, and the log says so."""
    follower = follower_of(people_type=kind)
    for k in range(15):
        content = persons([0.1 * k, 5.0 - 0.05 * k])[kind]
        stamp = {"header": header(10**9 + k * 10**8, "map")}
        answers = answered(follower, serialize(kind, stamp | content))
    rows = rows_of(answers["predictions"])
    last = rows[(rows["mode"] == 0) & (rows["step"] == 10)]
    if PEOPLE_FIELDS[kind].id not in ("", "uuid.uuid"):
        assert last["track_id"].tolist() == [0, 1]
    assert len(last) == 2
    np.testing.assert_allclose(np.sort(last["x"]), [2.8, 4.3], atol=0.6)


@pytest.mark.parametrize("nobody", ["", "nan", "-1"])
def test_who_is_nobody_by_the_id_is_followed_by_the_place(nobody, caplog):
    """As for an empty id: in bags these are one rule, too."""
    follower = follower_of()
    for k in range(20):
        here = [("eve", (0.0, 0.0)), (nobody, (4.0 + 0.1 * k, 3.0)), (nobody, (9.0, 9.0 - 0.1 * k))]
        several = [{"name": name, "position": dict(zip("xy", at, strict=True))} for name, at in here]
        content = {"header": header(10**9 + k * 10**8, "map"), "people": several[:: 1 - 2 * (k % 2)]}
        answers = answered(follower, serialize(PEOPLE, content))
    found = answers["predictions/people"]["people"]
    assert sorted(one["name"] for one in found) == ["#1", "#2", "eve"]
    moves = sorted(round(one["velocity"]["x"] - one["velocity"]["y"]) for one in found)
    assert moves == [0, 1, 1]
    assert caplog.records


def test_after_an_error_everything_goes_on():
    follower, plain = follower_of(), follower_of()
    answered(follower, people(1.0, anna=(0.0, 0.0)))
    for wrong in (b"", b"\0\1\0\0\xff\xff\xff\xff", people(1e9, anna=(0.0, 0.0))[:20]):
        with pytest.raises(Exception, match=r".*"):
            answered(follower, wrong)
    answered(plain, people(1.0, anna=(0.0, 0.0)))
    last = people(1.3, anna=(0.3, 0.0))
    np.testing.assert_array_equal(
        rows_of(answered(follower, last)["predictions"]), rows_of(answered(plain, last)["predictions"])
    )


# What was learned at the place


def test_what_was_learned_is_kept_in_a_file_and_a_damaged_one_is_said_and_replaced(tmp_path, caplog):
    path = tmp_path / "hall.json"
    first = follower_of(place_file=str(path))
    first.load_place()
    first.save_place()
    written = path.read_bytes()
    for raw, said in (
        (written, "INFO"),
        (written[:-20], "WARNING"),
    ):
        path.write_bytes(raw)
        caplog.clear()
        again = follower_of(place_file=str(path))
        with caplog.at_level("INFO"):
            again.load_place()
        assert said in {record.levelname for record in caplog.records}
        again.save_place()
        assert path.read_bytes() == written
    assert (tmp_path / "hall.json.unused").read_bytes() == written[:-20]
    assert len(list(tmp_path.iterdir())) == 2


def test_no_file_that_was_put_aside_replaces_another_one(tmp_path):
    path = tmp_path / "hall.json"
    for text in ("first", "second", "third"):
        path.write_text(text)
        follower_of(place_file=str(path)).load_place()
    kept = {each.name: each.read_text() for each in tmp_path.iterdir()}
    assert kept == {
        "hall.json.unused": "first",
        "hall.json.unused1": "second",
        "hall.json.unused2": "third",
    }


def test_a_file_that_cannot_be_written_ends_nothing_and_is_said(tmp_path, caplog):
    follower = follower_of(place_file=str(tmp_path))
    for _ in range(2):
        guarded("what was learned is not kept", follower.save_place)()
    assert caplog.text.count(f"what was learned is not kept: {tmp_path}") == 2
    guarded("message of 'map' left out", follower.map_came)(b"?")
    assert "message of 'map' left out: message = '1 bytes', but it must be a nav_msgs/" in caplog.text
    guarded("message of 'map' left out", follower.map_came)(None)
    assert "message of 'map' left out: TypeError: " in caplog.text


def test_a_tilde_is_the_home_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    follower = follower_of(place_file="~/hall.json", model="~/large")
    follower.save_place()
    assert [str(each.relative_to(tmp_path)) for each in tmp_path.rglob("*.json")] == ["home/hall.json"]
    assert follower.settings.folder == tmp_path / "home/large"


def test_without_a_name_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    follower = follower_of()
    follower.load_place()
    follower.save_place()
    assert not list(tmp_path.iterdir())


def test_fields_of_any_type_can_be_named():
    """Messages of an unknown type are decoded by the node; here by the known definition."""
    kind = "spencer_tracking_msgs/msg/TrackedPersons"
    settings = NodeSettings(
        use_map=False,
        people_type="my_msgs/msg/Tracks",
        people_fields="tracks,id=track_id,position=pose.pose.position",
    )
    predictor = OnlinePredictor.load(None, settings.online())
    follower = Follower(predictor, settings, decode_people=lambda raw: decode(raw, kind))
    raw = serialize(kind, {"header": header(10**9, "map")} | persons([1.0, 3.0])[kind])
    assert set(rows_of(answered(follower, raw)["predictions"])["track_id"]) == {0, 1}


@pytest.mark.parametrize(
    "wrong",
    [
        {"people_type": "my_msgs/msg/Tracks"},
        {"people_type": "tracks", "people_fields": "tracks,position=position"},
        {"people_fields": "tracks"},
        {"max_age_s": 2.5},
        {"ignore_near_robot_m": -1.0},
    ],
)
def test_parameters_out_of_range_are_refused(wrong):
    with pytest.raises(ValueRuleError):
        NodeSettings(**wrong)


@pytest.mark.parametrize("ignore_m", [0.0, 0.3])
def test_detections_near_the_robot_can_be_ignored(ignore_m):
    follower = follower_of(ignore_near_robot_m=ignore_m)
    turn, at = Rotation.identity(), np.array([5.0, 1.0, 0.0])
    follower.transforms_came(transforms(transform("map", "base_link", turn, at, 1.0)), 1.0, False)
    answers = answered(follower, people(1.0, robot=(5.2, 1.0), eve=(5.4, 1.0)))
    names = {person["name"] for person in answers["predictions/people"]["people"]}
    assert names == ({"robot", "eve"} if ignore_m == 0.0 else {"eve"})
    assert follower.counts.near_robot == (ignore_m > 0.0)


def test_without_a_map_there_are_no_grids():
    settings = NodeSettings(use_map=False, occupancy_cell_m=0.5)
    follower = Follower(OnlinePredictor.load(None, settings.online()), settings)
    topics = answered(follower, people(1.0, eve=(1.0, 1.0))).keys()
    assert "predictions/markers" in topics
    assert not any(topic.startswith("predicted_occupancy") for topic in topics)


@pytest.mark.parametrize("cell_m", [0.02, 0.1, 0.5])
def test_grids_cover_the_map_in_cells_of_at_least_0_1_m(cell_m):
    follower = follower_of(occupancy_cell_m=cell_m)
    info = answered(follower, people(1.0, eve=(1.0, 1.0)))["predicted_occupancy/horizon"]["info"]
    assert info["resolution"] == max(cell_m, 0.1)
    assert info["width"] * info["resolution"] == pytest.approx(60.0)
