"""What the ROS node does between messages: bytes as they are on the wire in, contents of messages out."""

import os

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pedpred.errors import ValueRuleError
from pedpred.ros.message_types import known_types, serialize
from pedpred.ros.scene_messages import header
from pedpred.ros2.outputs import output_types
from pedpred.ros2.wire import decode
from tests.bags import PEOPLE, Store
from tests.following import UNMOVED, answered, contents, follower_of, move, people, rows_of, seen, tracks_of
from tests.forked import run_forked
from tests.robots import STANDING, from_robot, robot

POSES = "geometry_msgs/msg/PoseArray"


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


def test_a_message_without_people_is_answered_on_every_topic(caplog):
    """Also in a frame that nobody knows: trackers fill in nothing when there are no people."""
    follower = follower_of(use_map=True, people_type=POSES, occupancy_cell_m=0.5)
    published = answered(follower, serialize(POSES, {"header": header(10**9, "camera")}))
    assert published.keys() == output_types(follower.settings, 10).keys() - {"predictions/names"}
    assert published["predictions"]["width"] == 0
    assert not caplog.records


@pytest.mark.parametrize(("kind", "numbers"), [(PEOPLE, {0, 1}), (POSES, {1, 2})])
def test_people_are_followed_with_and_without_ids(kind, numbers):
    follower, store = follower_of(people_type=kind), Store()
    for k in range(15):
        here = {"0": (0.1 * k, 1.0), "1": (5.0 - 0.05 * k, 1.0)}
        published = answered(follower, store.raw(kind, store.people(kind, 1.0 + k / 10, here)))
    assert tracks_of(published) == numbers
    rows = rows_of(published["predictions"])
    last = rows[(rows["mode"] == 0) & (rows["step"] == 10)]
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


def test_somebody_without_a_place_costs_nobody_the_frame(caplog):
    follower = follower_of()
    published = answered(follower, people(1.0, eve=(np.nan, 0.0), ben=(3.0, 1.0)))
    assert seen(published).keys() == {"ben"}
    assert follower.counts.without_forecast == 1
    assert caplog.records
    with pytest.raises(ValueRuleError):
        answered(follower, people(1.1, ben=(3.0, 1.0))[:20])
    assert follower.counts.refused == 1


# Frames


@pytest.mark.parametrize(("identities", "jump_m", "jump_rad"), [("given", 0.3, 0.0), ("assigned", 8.0, 2.0)])
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
    for k in range(240):
        at_s = 100.0 + k / 30
        if k >= 120:
            move(follower, at_s - 4.0, ("map", "base_link", robot(at_s - 4.0)))
        answers.append("predictions" in answered(follower, people(at_s, "base_link", eve=(1, 0)), k / 30))
    assert sum(answers[150:]) > 0.7 * len(answers[150:])


def test_people_who_wait_too_long_are_left_out():
    """So are those of a frame without a name; poses of before and after do not help."""
    follower = follower_of(transform_timeout_s=0.2)
    for at_s in (100.0, 100.1):
        move(follower, at_s, ("odom", "base_link", robot(at_s)))
    move(follower, 100.0, ("map", "odom", UNMOVED), fixed=True)
    for lost, (frame, now_s) in enumerate((("base_link", 0.0), ("", 1.0)), start=1):
        answered(follower, people(100.5, frame, eve=(1.0, 0.0)), now_s)
        assert list(follower.outputs(now_s + 0.1)) == list(follower.outputs(now_s + 0.3)) == []
        assert follower.counts.lost == lost


def test_detections_near_the_robot_can_be_ignored():
    for ignore_m, expected in ((0.0, {"robot", "eve"}), (0.3, {"eve"})):
        follower = follower_of(ignore_near_robot_m=ignore_m)
        move(follower, 1.0, ("map", "base_link", (Rotation.identity(), np.array([5.0, 1.0, 0.0]))))
        assert seen(answered(follower, people(1.0, robot=(5.2, 1.0), eve=(5.4, 1.0)))).keys() == expected
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


# Start

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


def test_the_first_people_do_not_wait_for_what_is_done_once(tmp_path):
    """Types of messages are read and written for the first time before the node subscribes to people."""
    done = run_forked(_FIRST_MESSAGE, tmp_path, os.environ)
    assert done.returncode == 0, done.stderr
