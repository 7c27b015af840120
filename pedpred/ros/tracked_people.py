"""Adapters for messages of tracked people, one line each; only field names matter, not classes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

Adapter = Callable[[Any], Iterator[tuple[object, Any]]]
"""A message -> (name, position with x and y in m) of every person in it."""


def _poses(message: Any) -> Iterator[tuple[object, Any]]:
    """Poses have no names: the index in the list identifies the person."""
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
"""The supported message types. All have a header with stamp and frame."""


def seconds(stamp: Any) -> float:
    """Convert a ROS time stamp to s."""
    return float(stamp.sec + stamp.nanosec / 1e9)


class TrackNumbers:
    """Track numbers for names: a decimal number keeps its value, other names get -1, -2, ... in order."""

    def __init__(self) -> None:
        self._given: dict[str, int] = {}

    def number(self, name: object) -> int:
        """The number of a name, the same on every call."""
        text = str(name)
        if text.isascii() and text.isdecimal():
            return int(text)
        return self._given.setdefault(text, -1 - len(self._given))
