"""Bags of ROS 1 (.bag) and ROS 2 (a folder with metadata.yaml, a single .mcap or .db3), without ROS."""

from __future__ import annotations

import logging
from collections.abc import Collection, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from pedpred.errors import InputError, ValueRuleError, brief
from pedpred.files import check_input, translate_errors
from pedpred.reading.checks import check_speeds
from pedpred.ros.bag_content import Ground, Messages
from pedpred.ros.bag_reader import BagReader
from pedpred.ros.decoding import CDR, ROS1, Connection
from pedpred.ros.frame_tree import FrameTree, frame_name
from pedpred.ros.frames import Transform
from pedpred.ros.message_types import MAP, TRANSFORMS, TYPES, UPDATE_TYPE
from pedpred.ros.old_detections import Instant, People
from pedpred.ros.old_people import ADAPTERS, LABELLED
from pedpred.ros.places import check_lengths, check_several, warn_of_repeats
from pedpred.ros.planning import NO_MAP
from pedpred.ros.scene_messages import map_of_grid
from pedpred.ros.storages import opened
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.scenes.people import PERSON_CLASSES

_log = logging.getLogger(__name__)
_GRID = TYPES[MAP]
_REMEDY = f"A bag may hold {', '.join(sorted(ADAPTERS))} for people and {_GRID} for the map"
_MAP_REMEDY = "Choose one: --map-topic"
_TRANSFORMS = (TRANSFORMS, "tf/msg/tfMessage")
_LONGEST_S = 5.0
"""Longest usual time between two detections of a person that can be seconds."""
_FOLLOWED = (".zstd", ".zst", ".active")
"""Suffixes that follow that of a bag."""


def read_bag(
    path: Path,
    topic: str | None = None,
    transform: Transform | None = None,
    map_topic: str | None = None,
    classes: Collection[str] = PERSON_CLASSES,
    names: dict[int, str] | None = None,
) -> Scene:
    """Read the people and the map of a bag.

    Times are the messages' stamps, or the bag's own where stamps are zero or do not go on. Where stamps go
    back (`find_passes`), as in a recording that was played twice, the rest follows later with other ids.
    People in a frame that /tf moves are brought into the map's frame or, without a map, into `map` or the
    topmost frame. Velocities in messages are not read: the tracker estimates them.

    Detections without a place, an id, a stamp or a transform at their time, with a false stamp, of other
    classes than people, and second ones of a track in one instant, are left out with a warning. A bag that is
    cut, or was not closed, is read up to the cut, with a warning, and so is one in which one person, or
    some people, move impossibly fast.

    Args:
        path: a .bag, .db3 or .mcap file, or the folder of a ROS 2 bag.
        topic: of the people; optional where only one topic carries people.
        transform: of the people's frame, where it is not the map's; if it moves, of the topmost.
        map_topic: of the map; None: /map, or the only topic that is called map, or the only one that is
            neither a costmap nor predicted occupancy; "": the bag's maps are left out.
        classes: who is a person, where detections have classes.
        names: takes those of tracks whose numbers are not their names: number -> name.

    Returns:
        The scene, named after the file. The last message of the map's topic counts, with the updates after
        it; without one the ground is free.

    Raises:
        InputError: the file is not a bag, no topic or several carry people, several carry a map, people
            and map are in different frames, ids do not say who is who, places are degrees or not in
            metres, classes are named and the messages have none, or they make no scene.
    """
    check_input(path)
    problem = partial(InputError, path, None)
    with translate_errors(partial(problem, remedy=_REMEDY)), opened(path) as bag:
        connections = bag.connections
        topic, map_topic = (_as_in_bag(name, connections) for name in (topic, map_topic))
        sources = _people_topic(path, connections, topic)
        if set(classes) != set(PERSON_CLASSES) and (kind := sources[0].msgtype) != LABELLED:
            lack = f"{sources[0].topic} has no classes to choose from: it carries {kind}"
            raise InputError(path, None, lack, "Leave --class out")
        maps = _map_topic(path, connections, map_topic)
        ground, instants = _read(path, bag, [*sources, *maps, *_updates_of(maps, connections)], classes)
        topic = sources[0].topic
        with translate_errors(lambda lack: problem(f"{topic}: {lack}", remedy="")):
            people = People(instants, partial(_log.warning, "%s: %s: %s", path, topic))
            frame = None if ground is None else frame_name(ground.header.frame_id)
            position = people.in_one_frame(frame, transform, partial(_transforms, path, bag))
            trajectories = people.trajectories(position, names)
            dt_s = _checked_interval_s(path, trajectories)
        with translate_errors(partial(problem, remedy="")):
            free = partial(OccupancyMap.free_around, trajectories.position)
            name = Path(path.stem) if path.suffix in _FOLLOWED else path
            return Scene(name.stem, trajectories, free() if ground is None else map_of_grid(ground), dt_s)


def _read(
    path: Path, bag: BagReader, connections: Sequence[Connection], classes: Collection[str]
) -> tuple[Any, list[Instant]]:
    """The last map with the updates after it, None where there is none, and all messages of people.

    Messages that cannot be decoded are left out with a warning, unless all of people are such, or all maps;
    one that would unpack to too much is refused.
    """
    ground, instants = Ground(path), list[Instant]()
    people, maps = Messages(path, bag), Messages(path, bag)
    for connection, received_ns, raw in bag.messages(connections=connections):
        kind = connection.msgtype
        if kind in (_GRID, UPDATE_TYPE):
            if (message := maps.decoded(raw, connection)) is not None:
                ground.take(connection.topic, message, kind == UPDATE_TYPE)
        elif (message := people.decoded(raw, connection)) is not None:
            instants += Instant.all_of(message, kind, received_ns / 1e9, classes)
    if people.first is not None and not any(each.ids or each.others for each in instants):
        raise people.first
    people.tell()
    ground.tell()
    if maps.first is not None and ground.grid is None:
        raise maps.first
    maps.tell()
    return ground.grid, instants


def _updates_of(maps: Sequence[Connection], connections: Sequence[Connection]) -> list[Connection]:
    """The connections on which a map changes after it was published as a whole."""
    topics = {f"{one.topic}_updates" for one in maps}
    return [one for one in connections if one.msgtype == UPDATE_TYPE and one.topic in topics]


def _checked_interval_s(path: Path, people: Trajectories) -> float:
    """The usual time between two detections of a track, s; people who are impossibly fast are warned about.

    Raises:
        ValueRuleError: nobody was detected twice, times are not seconds, or lengths are not metres.
    """
    dt_s = people.usual_interval_s()
    if dt_s >= _LONGEST_S:
        rule = "a track must be seen every few seconds: stamps count seconds and nanoseconds"
        raise ValueRuleError("stamp", f"usually {dt_s:g} s between two detections", rule)
    check_several(people)
    check_lengths(people)
    check_speeds(str(path), people, any_speed=True)
    warn_of_repeats(path, people)
    return dt_s


def _transforms(path: Path, bag: BagReader) -> FrameTree:
    """All transforms of a bag."""
    tree, transforms = FrameTree(), Messages(path, bag)
    topics = [one for one in bag.connections if one.msgtype in _TRANSFORMS]
    for connection, received_ns, raw in bag.messages(connections=topics) if topics else ():
        if (message := transforms.decoded(raw, connection)) is not None:
            tree.add(message, received_ns / 1e9, fixed="static" in connection.topic)
    transforms.tell()
    return tree


def _as_in_bag(topic: str | None, connections: Sequence[Connection]) -> str | None:
    """A topic's name as the bag has it, with or without a slash before it."""
    bare = (topic or "").lstrip("/")
    return next((c.topic for c in connections if bare and c.topic.lstrip("/") == bare), topic)


def _people_topic(path: Path, connections: Sequence[Connection], topic: str | None) -> list[Connection]:
    """The connections that people are taken from: all publishers of one topic."""
    read = [c for c in connections if c.encoding in (CDR, ROS1)]
    carriers = [c for c in read if c.msgtype in ADAPTERS and topic in (None, c.topic)]
    if len({(c.topic, c.msgtype) for c in carriers}) == 1:
        return carriers
    candidates = {
        c.topic: c.msgtype if c in read else f"{c.msgtype} in {c.encoding}" for c in carriers or connections
    }
    lack = "no topic carries people" if topic is None else f"{topic} carries no people"
    if carriers:
        lack = "several topics carry people: choose one (--topic)"
    raise InputError(path, None, f"{lack}, among {brief(candidates)}", _REMEDY)


def _map_topic(path: Path, connections: Sequence[Connection], topic: str | None) -> list[Connection]:
    """The connections that the map is taken from; none without a map."""
    grids = [c for c in connections if c.msgtype == _GRID and c.encoding in (CDR, ROS1)]
    names = sorted({c.topic for c in grids})
    if topic is None:
        called_map = [name for name in names if name.rpartition("/")[2] == MAP[1:]]
        others = [name for name in names if not NO_MAP.search(name)]
        chosen = [MAP] if MAP in names else called_map or others
        if len(chosen) > 1:
            raise InputError(path, None, f"several topics carry a map: {brief(chosen)}", _MAP_REMEDY)
        if names and not chosen:
            _log.warning(
                "%s: no map, the ground is free: %s are not maps. %s", path, brief(names), _MAP_REMEDY
            )
    else:
        chosen = [topic] if topic else []
        if set(chosen) - set(names):
            raise InputError(path, None, f"{topic} carries no map, among {brief(names)}", _MAP_REMEDY)
    return [c for c in grids if c.topic in chosen]
