"""The ROS 2 interfaces of a recording: which topic carries what, and the definitions that go along.

`interfaces.msg` holds the fields of the public definitions (common_interfaces of ROS 2 Humble and
later, people_msgs), separated as an MCAP schema wants them.
"""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files

MAP, PEOPLE, MARKERS, FRAMES = "/map", "/people", "/markers", "/tf_static"

TYPES = {
    MAP: "nav_msgs/msg/OccupancyGrid",
    PEOPLE: "people_msgs/msg/People",
    MARKERS: "visualization_msgs/msg/MarkerArray",
    FRAMES: "tf2_msgs/msg/TFMessage",
}
"""The message type of each topic."""

_SEPARATOR = "=" * 80 + "\nMSG: "
_NESTED = re.compile(r"^(\w+/\w+)(?:\[\])? ", re.MULTILINE)


def definition(message_type: str) -> str:
    """The definition of a type, followed by those of all types that it is made of (`ros2msg`).

    Args:
        message_type: such as `people_msgs/msg/People`.
    """
    wanted = [message_type.replace("/msg/", "/")]
    for name in wanted:  # grows while it is walked
        wanted += [inner for inner in _NESTED.findall(_definitions()[name]) if inner not in wanted]
    first, *inner = wanted
    return _definitions()[first] + "".join(f"{_SEPARATOR}{name}\n{_definitions()[name]}" for name in inner)


@cache
def _definitions() -> dict[str, str]:
    """Fields of every known type by its name."""
    text = files("pedpred.ros").joinpath("interfaces.msg").read_text()
    parts = (part.split("\n", 1) for part in text.split(_SEPARATOR)[1:])
    return {name: fields for name, fields in parts}
