"""The core of the example node, with stand-ins for ROS messages."""

import importlib.util
from pathlib import Path
from types import SimpleNamespace as Message

import numpy as np
import pytest

from pedpred.errors import ValueRuleError
from pedpred.online import OnlinePredictor
from pedpred.ros import Transform
from pedpred.ros.message_types import known_types, serialize
from pedpred.ros.planning import ROW
from pedpred.scenes import OccupancyMap


@pytest.fixture(scope="module")
def node():
    path = Path(__file__).parents[1] / "examples" / "ros2_node.py"
    spec = importlib.util.spec_from_file_location("ros2_node", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def people(time_s, frame="map", **positions):
    header = Message(stamp=Message(sec=int(time_s), nanosec=round(time_s % 1 * 1e9)), frame_id=frame)
    here = [Message(name=name, position=Message(x=x, y=y)) for name, (x, y) in positions.items()]
    return Message(header=header, people=here)


def grid(occupancy, frame="map"):
    turn, corner = Message(x=0.0, y=0.0, z=0.0, w=1.0), Message(x=occupancy.origin[0], y=occupancy.origin[1])
    width, height = occupancy.occupied.shape
    origin = Message(position=corner, orientation=turn)
    info = Message(resolution=0.1, width=width, height=height, origin=origin)
    return Message(
        header=Message(frame_id=frame), info=info, data=np.where(occupancy.occupied.T, 100, 0).ravel()
    )


def test_messages_give_the_forecasts_of_the_predictor(node, model):
    wall = OccupancyMap(np.ones((10, 40), bool), np.array([1.0, -2.0]), 0.1)
    follower = node.Follower(OnlinePredictor.load(model[0]), "people_msgs/msg/People")
    robot = OnlinePredictor.load(model[0])
    follower.map_came(grid(wall))
    robot.set_map(wall)
    for k in range(8):
        now = 1_700_000_000.0 + k / 4
        forecast = follower.people_came(people(now, anna=(0.2 * k, 0.0), ben=(3.0, 0.1 * k)))
        expected = robot.update(now, [-1, -2], [[0.2 * k, 0.0], [3.0, 0.1 * k]])
        np.testing.assert_array_equal(forecast.track_id, [-2, -1])
        np.testing.assert_allclose(forecast.position, expected.position, atol=1e-6)
    assert len(follower.people_came(people(1_700_000_009.0))) == 0


def follower_of(node, model, **options):
    return node.Follower(OnlinePredictor.load(model[0]), "people_msgs/msg/People", **options)


def test_somebody_without_a_place_costs_nobody_else_the_frame(node, model, caplog):
    odd, plain = (follower_of(node, model) for _ in range(2))
    for now in (1.0, 1.2, 1.4):
        there = {"anna": (now, 0.0), "ben": (3.0, now)}
        forecast = odd.people_came(people(now, eve=(np.nan, 0.0), **there))
        expected = plain.people_came(people(now, ben=there["ben"], anna=there["anna"]))
        assert len(forecast) == 2
        np.testing.assert_allclose(np.sort(forecast.position, 0), np.sort(expected.position, 0), atol=1e-6)
    assert "1 without a place, the first at 1.2 s" in caplog.text


def test_after_an_error_the_node_lives_on(node, model):
    follower, told, heard = follower_of(node, model), [], []
    callback = node.guarded(lambda message: heard.append(list(follower.answers(message))), told.append)
    for message in (
        people(1.0, anna=(0.0, 0.0)),
        Message(),
        None,
        people(1e12),
        people(1.4, anna=(0.4, 0.0)),
    ):
        callback(message)
    assert len(heard) == 2
    assert [text.startswith("message left out: ") for text in told] == [True] * 3
    assert "AttributeError" in told[0]
    assert "time_s" in told[2]


def test_people_in_another_frame_are_forecast_in_the_maps(node, model):
    free = OccupancyMap(np.zeros((10, 10)), np.zeros(2), 0.1)
    lost = follower_of(node, model)
    lost.map_came(grid(free))
    with pytest.raises(ValueRuleError, match="frame_id"):
        lost.people_came(people(1.0, frame="odom", anna=(1.0, 0.0)))
    turned = follower_of(node, model, transform=Transform(10.0, 20.0, np.pi / 2))
    turned.map_came(grid(free))
    (_, _, cloud), *_ = turned.answers(people(1.0, frame="odom", anna=(1.0, 0.0)))
    rows = np.frombuffer(cloud["data"].tobytes(), ROW)
    assert cloud["header"]["frame_id"] == "map"
    assert np.hypot(rows["x"] - 10, rows["y"] - 21).max() < 10


def test_forecasts_are_published_for_planners_and_viewers(node, model):
    """As bytes that other nodes decode; what is late is not published again."""
    follower = follower_of(node, model, cell_m=0.5)
    message = people(1.5, anna=(0.0, 0.0), ben=(2.0, 1.0))
    published = {topic: (kind, content) for topic, kind, content in follower.answers(message)}
    steps = [f"/predicted_occupancy/step_{step}" for step in range(1, 11)]
    assert list(published) == ["/predictions", "/predictions/markers", *steps]
    for kind, content in published.values():
        decoded = known_types().deserialize_cdr(serialize(kind, content), kind)
        assert kind.endswith("MarkerArray") or decoded.header.frame_id == "map"
    clearing, *lines = published["/predictions/markers"][1]["markers"]
    assert clearing["action"] == 3
    assert {line["ns"] for line in lines} == {"pedpred", "pedpred ellipse"}
    assert published[steps[0]][1]["data"].max() > 0
    assert list(follower.answers(people(1.2, anna=(0.0, 0.0)))) == []
