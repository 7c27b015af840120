"""ROS message types: the topics of a recording, the known definitions, and messages as bytes (CDR)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pedpred.ros.definitions import EDITIONS

TRANSFORMS, UPDATE_TYPE = "tf2_msgs/msg/TFMessage", "map_msgs/msg/OccupancyGridUpdate"
MAP, PEOPLE, MARKERS, FRAMES = "/map", "/people", "/markers", "/tf_static"

TYPES = {
    MAP: "nav_msgs/msg/OccupancyGrid",
    PEOPLE: "people_msgs/msg/People",
    MARKERS: "visualization_msgs/msg/MarkerArray",
    FRAMES: TRANSFORMS,
}
"""The message type of each topic."""

_EMPTY = {"string": "", "bool": False}


@cache
def known_editions(ros1: bool) -> tuple[Any, ...]:
    """A `rosbags` type store for each edition of the packages that hold people, the latest first.

    Args:
        ros1: whether the other types are those of ROS 1 Noetic instead of ROS 2 Humble.
    """
    stores = []
    for edition in EDITIONS:
        store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        for name, fields in edition.items():
            store.register(get_types_from_msg(fields, name))
        if ros1:
            store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TRANSFORMS))
        stores.append(store)
    return tuple(stores)


def known_types() -> Any:
    """The latest of `known_editions` for ROS 2."""
    return known_editions(ros1=False)[0]


def definition(kind: str) -> str:
    """The definition of a type and of all types in it, as an MCAP schema (`ros2msg`)."""
    return str(known_types().generate_msgdef(kind, ros_version=2)[0])


def deserialize(raw: bytes, kind: str, ros1: bool = False) -> Any:
    """Decode a message by the first known edition of its type that fits it.

    Args:
        raw: the message.
        kind: its type, such as `people_msgs/msg/People`.
        ros1: whether it is serialised as in ROS 1, and not as CDR.

    Raises:
        Exception: no edition fits; see `pedpred.files.translate_errors`.
    """
    problem: Exception = KeyError(f"a definition of {kind}")
    for types in known_editions(ros1):
        if kind in types.fielddefs:
            try:
                return types.deserialize_ros1(raw, kind) if ros1 else types.deserialize_cdr(raw, kind)
            except Exception as cause:  # whatever rosbags raises on a message of another edition
                problem = cause
    raise problem


def serialize(kind: str, content: Mapping[str, Any]) -> bytes:
    """Encode a message as CDR.

    Args:
        kind: its type.
        content: nested dictionaries of fields, or messages of rosbags; missing fields are zero, empty or
            false.
    """
    return bytes(known_types().serialize_cdr(_message(kind, content), kind, little_endian=True))


def _message(kind: str, content: Any) -> Any:
    if not isinstance(content, dict):
        return content
    make, fields, defaults = _layout(kind)
    return make(**(defaults | {name: _value(*fields[name], value) for name, value in content.items()}))


@cache
def _layout(kind: str) -> tuple[Any, dict[str, tuple[Nodetype, Any]], dict[str, Any]]:
    """Constructor of a message, definitions of its fields, and their default values."""
    fields = dict(known_types().fielddefs[kind][1])
    return known_types().types[kind], fields, {name: _default(*about) for name, about in fields.items()}


def _value(node: Nodetype, about: Any, content: Any) -> Any:
    """The value of a field as rosbags takes it; `about` is the second part of rosbags' field definition."""
    if node == Nodetype.BASE:
        return content
    if node == Nodetype.NAME:
        return _message(about, content)
    item, inner = about[0]
    if item == Nodetype.NAME:
        return [_message(inner, part) for part in content]
    return list(content) if inner[0] == "string" else np.asarray(content, inner[0])


def _default(node: Nodetype, about: Any) -> Any:
    """The value of a missing field; all messages share it, since serialising changes none."""
    if node == Nodetype.BASE:
        return _EMPTY.get(about[0], 0)
    if node == Nodetype.NAME:
        return _message(about, {})
    (item, inner), size = about
    if node == Nodetype.SEQUENCE:
        return _value(node, about, ())
    return [_message(inner, {})] * size if item == Nodetype.NAME else np.zeros(size, inner[0])
