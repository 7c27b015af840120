"""Messages of tracked people, one line each: who is where. They are read by their fields alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

Adapter = Callable[[Any], Iterator[tuple[object, Any]]]
"""A message -> (name, position with x and y in m) of everybody in it."""


def _poses(message: Any) -> Iterator[tuple[object, Any]]:
    """Poses have no names: who keeps the place in the list is taken for the same person."""
    return ((index, pose.position) for index, pose in enumerate(message.poses))


ADAPTERS: dict[str, Adapter] = {
    "people_msgs/msg/People": lambda m: ((p.name, p.position) for p in m.people),
    "spencer_tracking_msgs/msg/TrackedPersons": lambda m: (
        (t.track_id, t.pose.pose.position) for t in m.tracks
    ),
    "hunav_msgs/msg/Agents": lambda m: ((a.id, a.position.position) for a in m.agents),
    "vision_msgs/msg/Detection3DArray": lambda m: ((d.id, d.bbox.center.position) for d in m.detections),
    "geometry_msgs/msg/PoseArray": _poses,
}
"""What people may come as. All have a header with stamp and frame."""


def seconds(stamp: Any) -> float:
    """A ROS time stamp, s."""
    return float(stamp.sec + stamp.nanosec / 1e9)


class Names:
    """Whole numbers for names: a number keeps itself, any other name gets the next negative one."""

    def __init__(self) -> None:
        self._given: dict[str, int] = {}

    def number(self, name: object) -> int:
        """The same number for the same name, each time."""
        text = str(name)
        if text.isascii() and text.isdecimal():
            return int(text)
        return self._given.setdefault(text, -1 - len(self._given))
