"""Detections that have a header each, beside that of their message, in bags and for the live node."""

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg
from scipy.spatial.transform import Rotation

from pedpred.errors import InputError
from pedpred.ros import read_bag
from pedpred.ros.detections import Instant
from pedpred.ros.message_types import serialize
from pedpred.ros.scene_messages import header
from tests.bags import TF, Filled, Store, check_moving, transform
from tests.following import follower_of, transforms
from tests.following import transform as pose
from tests.robots import SPEED, STANDING, WALKING, from_robot, robot

BOXES, LEGS = "vision_msgs/msg/Detection3DArray", "people_msgs/msg/PositionMeasurementArray"
AGENTS = "pedsim_msgs/msg/AgentStates"
WITH_HEADERS = [BOXES, LEGS, AGENTS]
TIMES_S = 10.0 + np.arange(30) / 10


def content(kind, outer, *inner_and_place):
    """A message as a plain dict: headers are (time in s, frame), a place has an id."""
    made = {
        BOXES: ("detections", lambda who, at: {"id": who, "bbox": {"center": {"position": at}}}),
        LEGS: ("people", lambda who, at: {"object_id": who, "pos": at}),
        AGENTS: ("agent_states", lambda who, at: {"id": int(who), "pose": {"position": at}}),
    }
    field, one = made[kind]
    several = [
        {"header": head(*inner)} | one(who, dict(zip("xyz", map(float, at), strict=True)))
        for inner, who, at in inner_and_place
    ]
    return {"header": head(*outer), field: several}


def head(time_s, frame):
    return header(round(time_s * 1e9), frame)


def walk(kind, outer, inner, seen=from_robot):
    """Messages of two people whom a robot sees; headers are made from the time."""
    for time_s in TIMES_S:
        places = (("1", STANDING), ("2", WALKING + time_s * SPEED))
        yield content(kind, outer(time_s), *((inner(time_s), who, seen(at, time_s)) for who, at in places))


def bag(path, kind, messages, moves=True, times_s=TIMES_S):
    store = Filled(0)
    found = []
    for time_s in np.arange(9.9, 13.2, 0.05) if moves else ():
        moved = transform(store, "map", "base_link", robot(time_s), time_s)
        found.append((time_s, "/tf", TF, moved))
    for time_s, message in zip(times_s, messages, strict=True):
        found.append((time_s, "/seen", kind, store.types.deserialize_cdr(serialize(kind, message), kind)))
    found.sort(key=lambda one: one[0])
    store.write(path, [message for _, *message in found], times_s=[one[0] for one in found])
    return path


HEADERS = {
    "message": (lambda t: (t, "base_link"), lambda t: (0.0, "")),
    "both": (lambda t: (t, "base_link"), lambda t: (t, "base_link")),
    "no outer frame": (lambda t: (t, ""), lambda t: (t, "base_link")),
    "inner alone": (lambda t: (0.0, ""), lambda t: (t, "base_link")),
    "no outer stamp": (lambda t: (0.0, "base_link"), lambda t: (t, "/base_link")),
    "another frame": (lambda t: (t, "map"), lambda t: (t, "base_link")),
    "sent later": (lambda t: (t + 0.2 + 0.1 * np.sin(9 * t), ""), lambda t: (t, "base_link")),
    "stamped at start": (lambda t: (t, "base_link"), lambda t: (3.0, "base_link")),
}


@pytest.mark.parametrize("kind", WITH_HEADERS)
@pytest.mark.parametrize("case", HEADERS)
def test_what_the_message_leaves_empty_is_in_the_header_of_each_detection(kind, case, tmp_path, caplog):
    """Where both say something, the header of the detection counts: it is what the detection is in."""
    scene = read_bag(bag(tmp_path / "hall", kind, walk(kind, *HEADERS[case])))
    check_moving(scene)
    np.testing.assert_allclose(np.unique(scene.trajectories.time_s), TIMES_S)
    told = "30 messages are in 'map', and the headers of their detections in 'base_link', which counts"
    assert (f"/seen: {told}" in caplog.text) == (case == "another frame")
    assert "are zero" not in caplog.text


@pytest.mark.parametrize("kind", WITH_HEADERS)
@pytest.mark.parametrize("case", HEADERS)
def test_the_node_reads_headers_as_bags_are_read(kind, case, caplog):
    follower = follower_of(people_type=kind, identities="given")
    for time_s, message in zip(TIMES_S, walk(kind, *HEADERS[case]), strict=True):
        moved = transforms(pose("map", "base_link", *robot(time_s), time_s))
        follower.transforms_came(moved, time_s, False)
        follower.people_came(serialize(kind, message), round(time_s * 1e9), 0.0)
        answers = {answer.topic: answer.content for answer in follower.answers(0.0)}
    people = answers["predictions/people"]
    assert people["header"]["stamp"] == head(TIMES_S[-1], "map")["stamp"]
    found = {one["name"]: [one["position"][axis] for axis in "xy"] for one in people["people"]}
    np.testing.assert_allclose(found["1"], STANDING[:2], atol=0.05)
    np.testing.assert_allclose(found["2"], (WALKING + TIMES_S[-1] * SPEED)[:2], atol=0.15)
    assert ("in 'map', and the headers of their detections in 'base_link'" in caplog.text) == (
        case == "another frame"
    )


def test_detections_of_several_sensors_are_in_several_frames_and_at_several_times():
    seen = [((10.0, "left"), "1"), ((9.8, "right"), "2"), ((10.004, "left"), "3"), ((0.0, ""), "4")]
    message = content(BOXES, (10.1, "map"), *((inner, who, (1.0, 2.0, 3.0)) for inner, who in seen))
    types = Filled(0).types
    instants = Instant.all_of(types.deserialize_cdr(serialize(BOXES, message), BOXES), BOXES, 0.0)
    found = [(one.stamp_s, one.frame, one.ids) for one in instants]
    assert found == [(9.8, "right", ("2",)), (10.0, "left", ("1", "3")), (10.1, "map", ("4",))]


def test_one_detection_of_a_message_tells_for_the_others_whether_minus_one_is_nobody():
    """Also one that was seen later by another sensor."""
    follower = follower_of(people_type=LEGS, identities="given")
    seen = [((9.95, "map"), "-1", (1.0, 2.0, 0.0)), ((10.0, "map"), "-2", (5.0, 2.0, 0.0))]
    follower.people_came(serialize(LEGS, content(LEGS, (10.0, "map"), *seen)), 10 * 10**9, 0.0)
    answers = {answer.topic: answer.content for answer in follower.answers(0.0)}
    assert sorted(one["name"] for one in answers["predictions/people"]["people"]) == ["-1", "-2"]


def test_legs_of_ros_1_are_in_the_frame_of_the_moving_laser(tmp_path):
    """As people/leg_detector and its filters publish: the frame is in the measurements alone."""
    store = Store(Stores.ROS1_NOETIC)
    store.types.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))
    found = []
    for time_s in TIMES_S:
        lies = Rotation.identity(), np.array([0.5 * time_s, 0.0, 0.0])
        several = []
        for who, at in (("legs1", STANDING), ("legs2", WALKING + time_s * SPEED)):
            here = store.pose(*map(float, (at - lies[1])[:2]))
            several.append(
                store._one("people_msgs/msg/PositionMeasurement", who, here, store.header(time_s, "laser"))
            )
        message = store.make(LEGS, header=store.header(time_s + 0.05, ""), people=several)
        found.append((time_s, "/tf", TF, transform(store, "odom", "laser", lies, time_s)))
        found.append((time_s, "/legs", LEGS, message))
    store.write(tmp_path / "legs.bag", [one for _, *one in found], times_s=[one[0] for one in found])
    people = read_bag(tmp_path / "legs.bag").trajectories
    np.testing.assert_allclose(
        people.position[people.track_id == -1], [STANDING[:2]] * len(TIMES_S), atol=1e-9
    )
    np.testing.assert_allclose(np.unique(people.time_s), TIMES_S)


def test_people_in_no_frame_are_warned_about(tmp_path, caplog):
    walked = walk(LEGS, lambda t: (t, ""), lambda t: (t, ""), lambda at, t: at)
    check_moving(read_bag(bag(tmp_path / "hall", LEGS, walked, moves=False)))
    assert "/seen: 30 of 30 messages name no frame (header.frame_id is empty)" in caplog.text


@pytest.mark.parametrize("name", ["", "person"])
def test_ids_of_one_message_are_looked_at_together(name, tmp_path):
    """Where two cameras see a person each, who have the same id."""
    messages = []
    for time_s in TIMES_S:
        seen = [((time_s, "map"), name, (1.0, time_s, 0.0)), ((time_s - 0.03, "map"), name, (5.0, 0.0, 0.0))]
        messages.append(content(LEGS, (time_s, "map"), *seen))
    with pytest.raises(InputError, match=r"hall: /seen: id = .* (have different ones|say who is who)"):
        read_bag(bag(tmp_path / "hall", LEGS, messages, moves=False))


@pytest.mark.parametrize("kind", [LEGS, AGENTS, "spencer_tracking_msgs/msg/TrackedPersons"])
def test_nobody_is_minus_one_also_without_a_sign(kind, tmp_path):
    store, messages = Filled(0), []
    for k, time_s in enumerate(TIMES_S):
        nobody = -1 if kind == LEGS else 2**64 - 1
        here = ((7, (0.1 * k, 0.0)), (nobody, (9.0, 9.0)), (nobody, (5.0, 5.0 - 3.0 * (k % 2))))
        one, field = {
            LEGS: ("people_msgs/msg/PositionMeasurement", "people"),
            AGENTS: ("pedsim_msgs/msg/AgentState", "agent_states"),
        }.get(kind, ("spencer_tracking_msgs/msg/TrackedPerson", "tracks"))
        outer = store.header(time_s, "map")
        several = [store._one(one, who, store.pose(*at), outer) for who, at in here[: 3 if k % 3 else 1]]
        messages.append(("/seen", kind, store.make(kind, header=outer, **{field: several})))
    store.write(tmp_path / "hall", messages)
    assert read_bag(tmp_path / "hall").trajectories.track_id.tolist() == [7] * len(TIMES_S)


# Messages whose detections have many times


LATE_S = {
    "two cameras": [0, 0.1],
    "six sensors": [0.1 * k for k in range(6)],
    "near": [0.06 * k for k in range(6)],
}


@pytest.mark.parametrize("late_s", LATE_S.values(), ids=LATE_S.keys())
def test_people_of_sensors_that_are_late_keep_their_ids(late_s, tmp_path):
    messages = [
        content(
            BOXES, (t, "map"), *(((t - lag, "map"), str(k), (t, 2.0 * k, 0)) for k, lag in enumerate(late_s))
        )
        for t in TIMES_S
    ]
    people = read_bag(bag(tmp_path / "hall", BOXES, messages, moves=False)).trajectories
    assert np.unique(people.track_id, return_counts=True)[1].tolist() == [30] * len(late_s)


def test_people_of_many_frames_and_few_times_are_seen_when_the_message_says():
    """Two times in each of three frames are as many instants as six times."""
    frames = ["map", "left", "right"]
    messages = []
    for t in TIMES_S:
        rows = (((t - 0.2 * (k % 2), frames[k // 2]), str(k), (t, 2.0 * k, 0)) for k in range(6))
        messages.append(content(BOXES, (t, "map"), *rows))
    types = Filled(0).types
    read = [types.deserialize_cdr(serialize(BOXES, message), BOXES) for message in messages]
    instants = [Instant.all_of(each, BOXES, 0.0) for each in read]
    assert all(len({one.stamp_s for one in several}) == 1 for several in instants)


def test_tracks_with_the_stamp_of_their_last_detection_are_followed(tmp_path):
    """As of a tracker that goes on with those whom it does not see."""
    messages = []
    for step, t in enumerate(TIMES_S):
        seen_s = [TIMES_S[step - (step + k) % 7] if step >= 7 else t for k in range(7)]
        rows = (((seen, "map"), str(k), (t, 2.0 * k, 0)) for k, seen in enumerate(seen_s))
        messages.append(content(BOXES, (t, "map"), *rows))
    people = read_bag(bag(tmp_path / "hall", BOXES, messages, moves=False)).trajectories
    assert len(np.unique(people.track_id)) == 7
    assert len(people) == 210


def test_the_node_forecasts_people_who_are_stamped_earlier_than_it_waits():
    follower = follower_of(people_type=BOXES, identities="given")
    for t in TIMES_S:
        rows = ((t, "map"), "1", (t, 0, 0)), ((t - 0.8, "map"), "2", (t, 3, 0))
        follower.people_came(serialize(BOXES, content(BOXES, (t, "map"), *rows)), round(t * 1e9), 0.0)
        answers = {answer.topic: answer.content for answer in follower.answers(0.0)}
    assert sorted(one["name"] for one in answers["predictions/people"]["people"]) == ["1", "2"]
