"""Which topics of a bag are its people and its map."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

from pedpred.errors import InputError, brief
from pedpred.ros.decoding import Connection
from pedpred.ros.grids import NO_MAP
from pedpred.ros.message_types import MAP, TYPES, UPDATE_TYPE
from pedpred.ros.people import PEOPLE_FIELDS

_GRID = TYPES[MAP]
REMEDY = (
    f"A bag may hold {', '.join(sorted(PEOPLE_FIELDS))} for people and {_GRID} for the map; of another type, "
    "name the fields: --topic TOPIC --people people,id=id,position=pose.position"
)
_MAP_REMEDY = "Choose one: --map-topic"
_log = logging.getLogger(__name__)


def choose_people(
    path: Path, connections: Sequence[Connection], topic: str | None, any_type: bool
) -> list[Connection]:
    """Choose the connections of people: all publishers of one topic.

    Args:
        path: of the bag.
        connections: all of it.
        topic: of the people; None: the only one of a known type.
        any_type: whether the topic may have any type, and not only those of `PEOPLE_FIELDS`.

    Raises:
        InputError: no topic carries people, or several do.
    """
    topic = _name_in_bag(topic, connections)
    carriers = [
        one
        for one in connections
        if one.can_be_decoded and topic in (None, one.topic) and (any_type or one.msgtype in PEOPLE_FIELDS)
    ]
    if len({(one.topic, one.msgtype) for one in carriers}) == 1:
        return carriers
    problem = "no topic carries people" if topic is None else f"{topic} carries no people"
    if carriers:
        problem = "several topics carry people: choose one (--topic)"
    types = {one.topic: f"{one.msgtype} ({one.encoding})" for one in carriers or connections}
    raise InputError(path, None, f"{problem}, among {brief(types)}", REMEDY)


def choose_map(path: Path, connections: Sequence[Connection], topic: str | None) -> list[Connection]:
    """Choose the connections of the map and of its updates; none without a map.

    Args:
        path: of the bag.
        connections: all of it.
        topic: of the map, see `pedpred.ros.bags.read_bag`.

    Raises:
        InputError: several topics may be the map, or the given one has no grid.
    """
    topic = _name_in_bag(topic, connections)
    grids = sorted({one.topic for one in connections if one.can_be_decoded and one.msgtype == _GRID})
    if topic is None:
        called_map = [name for name in grids if name.rpartition("/")[2] == MAP[1:]]
        others = [name for name in grids if not NO_MAP.search(name)]
        chosen = [MAP] if MAP in grids else called_map or others
        if len(chosen) > 1:
            raise InputError(path, None, f"several topics carry a map: {brief(chosen)}", _MAP_REMEDY)
        if grids and not chosen:
            text = "%s: no map, the ground is free: %s are not maps. %s"
            _log.warning(text, path, brief(grids), _MAP_REMEDY)
    else:
        chosen = [topic] if topic else []
        if set(chosen) - set(grids):
            raise InputError(path, None, f"{topic} carries no map, among {brief(grids)}", _MAP_REMEDY)
    needed = {(name, _GRID) for name in chosen} | {(f"{name}_updates", UPDATE_TYPE) for name in chosen}
    return [one for one in connections if one.can_be_decoded and (one.topic, one.msgtype) in needed]


def _name_in_bag(topic: str | None, connections: Sequence[Connection]) -> str | None:
    """A topic's name as the bag has it, with or without a slash before it."""
    bare = (topic or "").lstrip("/")
    return next((one.topic for one in connections if bare and one.topic.lstrip("/") == bare), topic)
