"""A ROS 2 node: tracked people and a map in, the next three seconds of every person out as lines.

    python examples/ros2_node.py --type people_msgs/msg/People

Subscribes to the people (any type of `pedpred.ros.ADAPTERS`) and to `/map`, publishes `/predictions`
(visualization_msgs/MarkerArray) in the people's frame. People and map must be in one frame that does not
move. `Follower` does the work and knows no ROS; `main` connects it and needs rclpy.
"""

from __future__ import annotations

import argparse
from importlib import import_module
from typing import Any

from pedpred.online import OnlinePredictor
from pedpred.ros import ADAPTERS, TrackNumbers, map_of_grid, seconds
from pedpred.scenes import Forecast


class Follower:
    """Turns messages into forecasts; one instance per stream of people."""

    def __init__(self, predictor: OnlinePredictor, people_type: str):
        self._predictor, self._people_in = predictor, ADAPTERS[people_type]
        self._names = TrackNumbers()

    def map_came(self, message: Any) -> None:
        """Use a nav_msgs/OccupancyGrid from now on; a new map may come at any time."""
        self._predictor.set_map(map_of_grid(message))

    def people_came(self, message: Any) -> Forecast:
        """Forecast the people of a message. An error leaves the state as it was before the message."""
        people = [(self._names.number(name), (p.x, p.y)) for name, p in self._people_in(message)]
        ids, positions = zip(*people, strict=True) if people else ((), ())
        return self._predictor.update(seconds(message.header.stamp), list(ids), list(positions))


def lines(forecast: Forecast, header: Any, marker: type, point: type) -> list[Any]:
    """Return one line strip per person, after a marker that deletes the previous ones."""
    erase = marker(header=header, action=3)
    markers = [erase]
    for track_id, path in zip(forecast.track_id.tolist(), forecast.position.tolist(), strict=True):
        line = marker(header=header, ns="pedpred", id=track_id % 2**31, type=4, action=0)
        line.points = [point(x=x, y=y, z=0.0) for x, y in path]
        line.pose.orientation.w, line.scale.x = 1.0, 0.05
        line.color.r, line.color.g, line.color.a = 0.84, 0.37, 1.0
        markers.append(line)
    return markers


def main() -> None:
    """Spin until interrupted."""
    import rclpy
    from geometry_msgs.msg import Point
    from nav_msgs.msg import OccupancyGrid
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from visualization_msgs.msg import Marker, MarkerArray

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", help="a model folder (default: the one of the package)")
    parser.add_argument("--people", default="/people", help="topic of the tracked people")
    parser.add_argument("--type", default="people_msgs/msg/People", choices=sorted(ADAPTERS))
    given = parser.parse_args()
    package, _, name = given.type.split("/")
    people_type = getattr(import_module(f"{package}.msg"), name)

    rclpy.init()
    node = rclpy.create_node("pedpred")
    follower = Follower(OnlinePredictor.load(given.model), given.type)
    publisher = node.create_publisher(MarkerArray, "/predictions", 10)

    def people_came(message: Any) -> None:
        forecast = follower.people_came(message)
        publisher.publish(MarkerArray(markers=lines(forecast, message.header, Marker, Point)))

    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)  # maps are sent once
    node.create_subscription(OccupancyGrid, "/map", follower.map_came, latched)
    node.create_subscription(people_type, given.people, people_came, 10)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
