"""The people of one message: fields of known and other types, classes, stamps and frames."""

from types import SimpleNamespace as Message

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.errors import ValueRuleError
from pedpred.ros.detections import DetectionFrame, find_usable
from pedpred.ros.people import PEOPLE_FIELDS, PeopleFields, parse_fields
from pedpred.scenes import Trajectories
from tests.bags import Store

BOXES = "vision_msgs/msg/Detection3DArray"
ANY = PeopleFields("people", id="id", position="position", label="label")


def message_of(*people, sec=1, frame="map"):
    return Message(header=Message(stamp=Message(sec=sec, nanosec=0), frame_id=frame), people=list(people))


def person(number, position, label="person"):
    return Message(id=number, position=position, label=label)


def point(x, y, z=0.0):
    return Message(x=x, y=y, z=z)


def test_fields_are_parsed():
    given = "objects, id=track.id,position=pose.position, class=label"
    assert parse_fields(given) == PeopleFields("objects", "track.id", "pose.position", "label")
    assert parse_fields("points,position=") == PeopleFields("points", id="", position="")


@pytest.mark.parametrize("text", ["", "people", "people,id=id", "id=id,position=p", "people,position=p,x=1"])
def test_a_notation_that_is_not_understood_is_refused(text):
    with pytest.raises(ValueRuleError) as error:
        parse_fields(text)
    assert error.value.field == "people"


@pytest.mark.parametrize(
    ("written", "text"),
    [
        (7, "7"),
        ("anna", "anna"),
        (-1, "-1"),
        (2**64 - 1, "-1"),
        (np.arange(16, dtype=np.uint8), "000102030405060708090a0b0c0d0e0f"),
        (b"\x0a\xff", "0aff"),
    ],
)
def test_ids_are_text(written, text):
    seen = DetectionFrame.from_message(message_of(person(written, point(0.0, 0.0))), ANY, 0)
    assert seen.ids == (text,)


@pytest.mark.parametrize(
    "position", [point(1.0, 2.0, 3.0), [1.0, 2.0, 3.0], np.array([1.0, 2.0, 3.0], np.float32)]
)
def test_positions_are_messages_or_arrays(position):
    seen = DetectionFrame.from_message(message_of(person(1, position)), ANY, 0)
    assert seen.positions.tolist() == [[1.0, 2.0, 3.0]]


def test_a_list_of_positions_is_a_list_of_people():
    message = message_of(point(1.0, 2.0), point(3.0, 4.0))
    seen = DetectionFrame.from_message(message, parse_fields("people,position="), 0)
    assert seen.positions.tolist() == [[1, 2, 0], [3, 4, 0]]
    assert seen.ids == ("", "")


def test_positions_may_lack_a_height():
    flat = [person(1, [1.0, 2.0]), person(2, Message(x=3.0, y=4.0))]
    assert DetectionFrame.from_message(message_of(*flat), ANY, 0).positions.tolist() == [[1, 2, 0], [3, 4, 0]]


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1e300])
def test_impossible_coordinates_are_unknown(wrong):
    places = DetectionFrame.from_message(message_of(person(1, point(wrong, 2.0))), ANY, 0).positions
    np.testing.assert_array_equal(places, [[np.nan, 2.0, 0.0]])


@pytest.mark.parametrize("field", ["people", "id", "position", "label"])
def test_a_field_that_is_not_there_is_an_error(field):
    with pytest.raises(ValueRuleError):
        DetectionFrame.from_message(message_of(person(1, point(0, 0))), ANY._replace(**{field: "other"}), 0)


@pytest.mark.parametrize("field", ["id", "header.frame_id"])
def test_a_list_that_is_none_is_an_error(field):
    with pytest.raises(ValueRuleError):
        DetectionFrame.from_message(message_of(), ANY._replace(people=field), 0)


def test_a_message_without_a_stamp_is_of_its_arrival():
    seen = DetectionFrame.from_message(message_of(person(1, point(0, 0)), sec=0), ANY, 5 * 10**9)
    assert (seen.time_s, seen.is_stamped) == (5.0, False)
    seen = DetectionFrame.from_message(message_of(person(1, point(0, 0)), sec=3), ANY, 5 * 10**9)
    assert (seen.time_s, seen.is_stamped) == (3.0, True)


@pytest.mark.parametrize(("outer", "frame"), [("/map", "map"), ("", "camera")])
def test_the_frame_is_that_of_the_message(outer, frame):
    """Or of its detections, where it names none."""
    one = person(1, point(0, 0))
    one.header = Message(stamp=Message(sec=9, nanosec=0), frame_id="camera")
    seen = DetectionFrame.from_message(message_of(one, frame=outer), ANY, 0)
    assert (seen.frame, seen.time_s) == (frame, 1.0)


def test_a_message_may_have_headers_in_its_detections_alone():
    """As markers have."""
    one = person(1, point(0, 0))
    one.header = Message(stamp=Message(sec=9, nanosec=0), frame_id="camera")
    seen = DetectionFrame.from_message(Message(people=[one]), ANY, 0)
    assert (seen.frame, seen.time_s) == ("camera", 9.0)


# Classes


@pytest.mark.parametrize(
    ("labels", "classes", "kept"),
    [
        (("person", "chair"), None, (0,)),
        (("PEDESTRIAN", "CAR", ""), None, (0, 2)),
        (("human.pedestrian.adult", "Person_sitting", "manhole"), None, (0, 1)),
        (("wheelchair", "stroller", "bicycle"), None, (0, 1)),
        (("0", "56", "0"), ("0",), (0, 2)),
        (("chair", "person"), ("Chair", "person"), (0, 1)),
        (("chair", "person"), ("",), (0, 1)),
    ],
)
def test_only_people_are_taken_among_classes(labels, classes, kept):
    people = [person(k, point(0.0, 0.0), label) for k, label in enumerate(labels)]
    given = {} if classes is None else {"classes": classes}
    seen = DetectionFrame.from_message(message_of(*people), ANY, 0, **given)
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
    assert DetectionFrame.from_message(likely, fields, 0).others == ("chair",)
    assert DetectionFrame.from_message(boxes(edition=edition), fields, 0).ids == ("7",)


@pytest.mark.parametrize(("centre", "x"), [((3.0, 0.0), 3.0), ((0.0, 0.0), 5.0)])
def test_a_box_without_a_centre_is_at_its_likeliest_pose(centre, x):
    message = boxes(("person", 0.3, 4.0), ("person", 0.6, 5.0), centre=centre)
    assert DetectionFrame.from_message(message, PEOPLE_FIELDS[BOXES], 0).positions[0, 0] == x


def test_the_robot_of_a_simulator_is_left_out():
    agents = [Message(id=number, type=number, pose=Message(position=point(0, 0))) for number in range(4)]
    message = message_of()
    message.agent_states = agents
    fields = PEOPLE_FIELDS["pedsim_msgs/msg/AgentStates"]
    assert DetectionFrame.from_message(message, fields, 0).ids == ("0", "1", "3")


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
