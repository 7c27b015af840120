"""The people of one message: fields of known and other types, classes, stamps and frames."""

from types import SimpleNamespace as Message

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.ros.detections import DetectionFrame, find_usable
from pedpred.ros.people import PEOPLE_FIELDS, PeopleFields, parse_fields
from pedpred.scenes import Trajectories
from tests.bags import Store
from tests.refused import refused

BOXES = "vision_msgs/msg/Detection3DArray"
ANY = PeopleFields("people", id="id", position="position", label="label")


def message_of(*people, sec=1, frame="map"):
    return Message(header=Message(stamp=Message(sec=sec, nanosec=0), frame_id=frame), people=list(people))


def person(number, position, label="person"):
    return Message(id=number, position=position, label=label)


def frame_of(message, fields=ANY, received_ns=0, **classes):
    return DetectionFrame.from_message(message, fields, received_ns, **classes)


def point(x, y, z=0.0):
    return Message(x=x, y=y, z=z)


def test_fields_are_parsed():
    given = "objects, id=track.id,position=pose.position, class=label"
    assert parse_fields(given) == PeopleFields("objects", "track.id", "pose.position", "label")
    assert parse_fields("points,position=") == PeopleFields("points", id="", position="")


@pytest.mark.parametrize("text", ["people", "people,position=p,x=1"])
def test_a_notation_that_is_not_understood_is_refused(text):
    with refused("people"):
        parse_fields(text)


@pytest.mark.parametrize(
    ("written", "text"),
    [
        (7, "7"),
        ("anna", "anna"),
        (2**64 - 1, "-1"),
        (np.arange(4, dtype=np.uint8), "00010203"),
    ],
)
def test_ids_are_text(written, text):
    assert frame_of(message_of(person(written, point(0.0, 0.0)))).ids == (text,)


@pytest.mark.parametrize(
    ("position", "expected"),
    [
        (point(1.0, 2.0, 3.0), [1, 2, 3]),
        (np.array([1.0, 2.0], np.float32), [1, 2, 0]),
        (point(1e300, 2.0), [np.nan, 2, 0]),
    ],
    ids=str,
)
def test_positions_are_messages_or_arrays(position, expected):
    np.testing.assert_array_equal(frame_of(message_of(person(1, position))).positions, [expected])


def test_a_list_of_positions_is_a_list_of_people():
    found = frame_of(message_of(point(1.0, 2.0), point(3.0, 4.0)), parse_fields("people,position="))
    assert found.positions.tolist() == [[1, 2, 0], [3, 4, 0]]
    assert found.ids == ("", "")


@pytest.mark.parametrize(
    "wrong",
    [{"people": "header.frame_id"}, {"position": "x"}],
)
def test_a_field_that_is_not_there_is_an_error(wrong):
    with refused(""):
        frame_of(message_of(person(1, point(0, 0))), ANY._replace(**wrong))


@pytest.mark.parametrize(("sec", "time_s"), [(0, 5.0), (3, 3.0)])
def test_a_message_without_a_stamp_is_of_its_arrival(sec, time_s):
    found = frame_of(message_of(person(1, point(0, 0)), sec=sec), received_ns=5 * 10**9)
    assert (found.time_s, found.is_stamped) == (time_s, sec > 0)


@pytest.mark.parametrize(
    ("outer", "expected"), [("/map", ("map", 1.0)), ("", ("camera", 1.0)), (None, ("camera", 9.0))]
)
def test_the_header_of_detections_counts_if_there_is_no_other(outer, expected):
    one = person(1, point(0, 0))
    one.header = Message(stamp=Message(sec=9, nanosec=0), frame_id="camera")
    message = Message(people=[one]) if outer is None else message_of(one, frame=outer)
    found = frame_of(message)
    assert (found.frame, found.time_s) == expected


# Classes


@pytest.mark.parametrize(
    ("labels", "classes", "kept"),
    [
        (("PEDESTRIAN", "CAR", ""), None, (0, 2)),
        (("human.pedestrian.adult", "Person_sitting", "manhole"), None, (0, 1)),
        (("0", "56", "0"), ("0",), (0, 2)),
        (("chair", "person"), ("",), (0, 1)),
    ],
)
def test_only_people_are_taken_among_classes(labels, classes, kept):
    people = [person(k, point(0.0, 0.0), label) for k, label in enumerate(labels)]
    given = {} if classes is None else {"classes": classes}
    seen = frame_of(message_of(*people), **given)
    assert seen.ids == tuple(map(str, kept))
    assert sorted(seen.others) == sorted(label for k, label in enumerate(labels) if k not in kept)


def boxes(*results, edition=0, centre=(0.0, 0.0)):
    """A detection of vision_msgs; a result is (class, score, x of its pose)."""
    store, made = Store(edition), []
    for label, score, x in results:
        pose = store.make("geometry_msgs/msg/PoseWithCovariance", pose=store.pose(x, 1.0))
        if edition == 0:
            inner = store.make("vision_msgs/msg/ObjectHypothesis", class_id=label, score=score)
            likely = {"hypothesis": inner}
        else:
            likely = {"id": label, "score": score}
        made.append(store.make("vision_msgs/msg/ObjectHypothesisWithPose", **likely, pose=pose))
    box = store.make("vision_msgs/msg/BoundingBox3D", center=store.pose(*centre))
    one = store.make("vision_msgs/msg/Detection3D", results=made, bbox=box, id="7", tracking_id="7")
    return store.make(BOXES, header=store.header(1.0, "map"), detections=[one])


@pytest.mark.parametrize("edition", [0, 1])
def test_the_likeliest_class_of_a_box_counts(edition):
    fields = PEOPLE_FIELDS[BOXES]
    likely = boxes(("person", 0.3, 4.0), ("chair", 0.6, 5.0), edition=edition)
    assert frame_of(likely, fields).others == ("chair",)
    assert frame_of(boxes(edition=edition), fields).ids == ("7",)


@pytest.mark.parametrize(("centre", "x"), [((3.0, 0.0), 3.0), ((0.0, 0.0), 5.0)])
def test_a_box_without_a_centre_is_at_its_likeliest_pose(centre, x):
    message = boxes(("person", 0.3, 4.0), ("person", 0.6, 5.0), centre=centre)
    assert frame_of(message, PEOPLE_FIELDS[BOXES]).positions[0, 0] == x


def test_the_robot_of_a_simulator_is_left_out():
    agents = [Message(id=number, type=number, pose=Message(position=point(0, 0))) for number in range(4)]
    message = message_of()
    message.agent_states = agents
    fields = PEOPLE_FIELDS["pedsim_msgs/msg/AgentStates"]
    assert frame_of(message, fields).ids == ("0", "1", "3")


# Doubles


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2), st.sampled_from([0.0, 1.0, np.nan]))))
def test_usable_detections_make_trajectories_and_none_is_lost(rows):
    time_s, track_id, x = (
        (np.array(column, float) for column in zip(*rows, strict=True)) if rows else [np.zeros(0)] * 3
    )
    position = np.stack([x, np.zeros_like(x)], axis=-1)
    kept, left_out = find_usable(time_s, track_id.astype(np.int64), position)
    Trajectories(time_s[kept], track_id[kept], position[kept])
    pairs = {(t, track) for t, track, at in rows if np.isfinite(at)}
    assert kept.sum() == len(pairs)
    assert bool(left_out) == (len(pairs) < len(rows))
