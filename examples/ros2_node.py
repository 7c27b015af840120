"""A ROS 2 node: tracked people and a map in, the next three seconds of every person out.

    python examples/ros2_node.py --type people_msgs/msg/People --grid 0.2

Subscribes to the people (any type of `pedpred.ros.ADAPTERS`) and to `/map`. Publishes, in the map's frame,

    /predictions                 sensor_msgs/PointCloud2: modes, weights, covariances (pedpred.ros.planning)
    /predictions/markers         visualization_msgs/MarkerArray: the same to look at
    /predicted_occupancy/step_1  nav_msgs/OccupancyGrid, and so on for each step: with --grid

`Follower` does the work and knows no ROS; `main` connects it and needs rclpy.
"""

from __future__ import annotations

import argparse
import logging
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

import numpy as np

from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.warming import warm_up
from pedpred.ros import ADAPTERS, TrackNumbers, Transform, find_usable, map_of_grid, seconds
from pedpred.ros.frames import check_frames
from pedpred.ros.markers import forecast_message
from pedpred.ros.message_types import serialize
from pedpred.ros.planning import GRID_TYPE, PREDICTIONS, PREDICTIONS_TYPE, grid_messages, predictions_message
from pedpred.ros.scene_messages import Content
from pedpred.scenes import Forecast, OccupancyMap

MARKERS, MARKERS_TYPE = f"{PREDICTIONS}/markers", "visualization_msgs/msg/MarkerArray"
_COLOUR = (0.84, 0.37, 0.0)
_log = logging.getLogger("pedpred")


class Follower:
    """Turns messages into forecasts; one instance per stream of people."""

    def __init__(
        self,
        predictor: OnlinePredictor,
        people_type: str,
        transform: Transform | None = None,
        cell_m: float | None = None,
    ):
        self._predictor, self._people_in, self._transform = predictor, ADAPTERS[people_type], transform
        self._names, self._cell_m = TrackNumbers(), cell_m
        self._map: OccupancyMap | None = None
        self._map_frame: str | None = None

    def map_came(self, message: Any) -> None:
        """Use a nav_msgs/OccupancyGrid from now on; a new map may come at any time."""
        occupancy = map_of_grid(message)
        self._predictor.set_map(occupancy)
        self._map, self._map_frame = occupancy, message.header.frame_id

    def people_came(self, message: Any) -> Forecast:
        """Forecast the people of a message; who has no place or comes twice is left out with a warning.

        After an error everything is as it was before the message.
        """
        check_frames({message.header.frame_id}, self._map_frame, self._transform)
        now = seconds(message.header.stamp)
        people = [(self._names.number(name), (place.x, place.y)) for name, place in self._people_in(message)]
        track_id = np.array([track for track, _ in people], np.int64)
        position = np.array([place for _, place in people], np.float64).reshape(-1, 2)
        kept, left_out = find_usable(np.full(len(people), now), track_id, position)
        if left_out:
            _log.warning(left_out)
        position = position[kept] if self._transform is None else self._transform.to_map(position[kept])
        return self._predictor.update(now, track_id[kept], position)

    def answers(self, message: Any) -> Iterator[tuple[str, str, Content]]:
        """Topic, type and content of what to publish after a message of people; nothing if it was late."""
        forecast, stamp = self.people_came(message), message.header.stamp
        if forecast.time_s != seconds(stamp):
            return
        present = stamp.sec * 10**9 + stamp.nanosec, self._map_frame or message.header.frame_id
        yield (
            PREDICTIONS,
            PREDICTIONS_TYPE,
            predictions_message(forecast.track_id, forecast.predictions, *present),
        )
        yield MARKERS, MARKERS_TYPE, forecast_message(forecast, _COLOUR, *present)
        if self._cell_m is not None:
            paths = forecast.predictions.path.reshape(-1, 2)
            ground = OccupancyMap.free_around(paths, cell_m=self._cell_m)
            ground = ground if self._map is None else self._map.free(self._cell_m)
            for topic, content in grid_messages(forecast.predictions, ground, *present).items():
                yield topic, GRID_TYPE, content


def guarded(callback: Callable[[Any], None], log: Callable[[str], None]) -> Callable[[Any], None]:
    """Return a callback that logs every error and goes on: a bad message must not end the node."""

    def called(message: Any) -> None:
        try:
            callback(message)
        except Exception as error:  # whatever is wrong with this message, the next one may be right
            log(f"message left out: {type(error).__name__}: {error}")

    return called


def main() -> None:
    """Spin until interrupted."""
    import rclpy
    from rclpy.qos import DurabilityPolicy, QoSProfile

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--model", help="a model folder (default: the one of the package)")
    parser.add_argument("--people", default="/people", help="topic of the tracked people")
    parser.add_argument("--type", default="people_msgs/msg/People", choices=sorted(ADAPTERS))
    pose = "pose of the people's frame in the map's frame, if they differ: m, m, rad"
    parser.add_argument("--transform", type=float, nargs=3, metavar=("X", "Y", "YAW"), help=pose)
    parser.add_argument(
        "--grid", type=float, metavar="M", help="publish predicted occupancy, in cells of this size"
    )
    noise = "standard deviation of a detection's coordinate, which covariances are not to include, m"
    parser.add_argument("--detection-noise-m", type=float, default=0.0, help=noise)
    given = parser.parse_args()

    warm_up(given.model)  # no frame waits for compiling
    rclpy.init()
    node = rclpy.create_node("pedpred")
    transform = None if given.transform is None else Transform(*given.transform)
    predictor = OnlinePredictor.load(given.model, OnlineSettings(detection_noise_m=given.detection_noise_m))
    follower = Follower(predictor, given.type, transform, given.grid)
    publishers: dict[str, Any] = {}

    def publish_answers(message: Any) -> None:
        for topic, kind, content in follower.answers(message):
            if topic not in publishers:
                publishers[topic] = node.create_publisher(_message_class(kind), topic, 10)
            publishers[topic].publish(serialize(kind, content))  # rclpy takes messages as bytes, too

    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)  # maps are sent once
    log = node.get_logger().error
    node.create_subscription(_message_class(GRID_TYPE), "/map", guarded(follower.map_came, log), latched)
    node.create_subscription(_message_class(given.type), given.people, guarded(publish_answers, log), 10)
    rclpy.spin(node)


def _message_class(kind: str) -> Any:
    package, _, name = kind.split("/")
    return getattr(import_module(f"{package}.msg"), name)


if __name__ == "__main__":
    main()
