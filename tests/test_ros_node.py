"""The core of the example node, with stand-ins for ROS messages."""

import importlib.util
from pathlib import Path
from types import SimpleNamespace as Message

import numpy as np
import pytest

from pedpred.errors import ValueRuleError
from pedpred.online import OnlinePredictor
from pedpred.scenes import OccupancyMap


@pytest.fixture(scope="module")
def node():
    path = Path(__file__).parents[1] / "examples" / "ros2_node.py"
    spec = importlib.util.spec_from_file_location("ros2_node", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def people(time_s, **positions):
    header = Message(stamp=Message(sec=int(time_s), nanosec=round(time_s % 1 * 1e9)), frame_id="map")
    here = [Message(name=name, position=Message(x=x, y=y)) for name, (x, y) in positions.items()]
    return Message(header=header, people=here)


def grid(occupancy):
    turn, corner = Message(x=0.0, y=0.0, z=0.0, w=1.0), Message(x=occupancy.origin[0], y=occupancy.origin[1])
    width, height = occupancy.occupied.shape
    origin = Message(position=corner, orientation=turn)
    info = Message(resolution=0.1, width=width, height=height, origin=origin)
    return Message(info=info, data=np.where(occupancy.occupied.T, 100, 0).ravel())


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


def test_a_bad_message_is_an_error_and_the_stream_goes_on(node, model):
    follower = node.Follower(OnlinePredictor.load(model[0]), "people_msgs/msg/People")
    follower.people_came(people(1.0, anna=(0.0, 0.0)))
    with pytest.raises(ValueRuleError, match="position"):
        follower.people_came(people(1.2, anna=(np.nan, 0.0)))
    assert len(follower.people_came(people(1.4, anna=(0.2, 0.0)))) == 1


def test_forecasts_are_drawn_as_lines(node, model):
    def marker(**fields):
        pose = Message(orientation=Message(w=0.0))
        return Message(**fields, pose=pose, scale=Message(x=0.0), color=Message(r=0.0, g=0.0, b=0.0, a=0.0))

    follower = node.Follower(OnlinePredictor.load(model[0]), "people_msgs/msg/People")
    message = people(1.0, anna=(0.0, 0.0))
    forecast = follower.people_came(message)
    erase, line = node.lines(forecast, message.header, marker, Message)
    assert erase.action == 3
    assert [(p.x, p.y) for p in line.points] == [tuple(p) for p in forecast.position[0].tolist()]
    assert 0 <= line.id < 2**31
