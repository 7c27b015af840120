"""ROS 2 message types: the topics of a recording, the known definitions, and messages as bytes (CDR)."""

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
def known_types() -> Any:
    """The `rosbags` type store with the messages of ROS 2 Humble and of the packages of `EDITIONS`."""
    return known_editions(ros1=False)[0]


@cache
def known_editions(ros1: bool) -> tuple[Any, ...]:
    """A type store for each edition of the packages that hold people, the latest first.

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


def definition(kind: str) -> str:
    """The definition of a type and of all types in it, as an MCAP schema (`ros2msg`).

    Args:
        kind: such as `people_msgs/msg/People`.
    """
    return str(known_types().generate_msgdef(kind, ros_version=2)[0])


def serialize(kind: str, content: Mapping[str, Any]) -> bytes:
    """A message as CDR.

    Args:
        kind: its type.
        content: nested dictionaries of fields, or messages of rosbags; missing fields are zero, empty or
            false.
    """
    message = _message(kind, content, {})
    return bytes(known_types().serialize_cdr(message, kind, little_endian=True))


_Built = dict[tuple[str, int], Any]
"""Messages by type and the identity of their content: what occurs in many places is built once."""


def _message(kind: str, content: Any, built: _Built) -> Any:
    if not isinstance(content, dict):
        return content
    key = kind, id(content)
    if key not in built:
        make, fields, usual = _plan(kind)
        values = {name: _value(*fields[name], value, built) for name, value in content.items()}
        built[key] = make(**(usual | values))
    return built[key]


@cache
def _plan(kind: str) -> tuple[Any, dict[str, tuple[Nodetype, Any]], dict[str, Any]]:
    """Constructor of a message, definitions of its fields, and their values where they are missing."""
    fields = dict(known_types().fielddefs[kind][1])
    return known_types().types[kind], fields, {name: _default(*about) for name, about in fields.items()}


def _value(node: Nodetype, about: Any, content: Any, built: _Built) -> Any:
    """The value of a field as rosbags takes it; `about` is the second part of rosbags' field definition."""
    if node == Nodetype.BASE:
        return content
    if node == Nodetype.NAME:
        return _message(about, content, built)
    item, inner = about[0]
    if item == Nodetype.NAME:
        return [_message(inner, part, built) for part in content]
    return list(content) if inner[0] == "string" else np.asarray(content, inner[0])


@cache
def _default(node: Nodetype, about: Any) -> Any:
    """The value of a missing field; serialising changes no message, so that all may share it."""
    if node == Nodetype.BASE:
        return _EMPTY.get(about[0], 0)
    if node == Nodetype.ARRAY and about[0][0] == Nodetype.BASE:
        return np.zeros(about[1], about[0][1][0])
    if node == Nodetype.ARRAY:
        return [_message(about[0][1], {}, {})] * about[1]
    return _value(node, about, {} if node == Nodetype.NAME else (), {})
