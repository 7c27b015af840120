"""Bags of ROS 1 (.bag) and ROS 2 (a folder, a single .mcap or .db3), without ROS."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.errors import InputError, PedpredError, ValueRuleError
from pedpred.files import check_input, translate_errors
from pedpred.reading.checks import check
from pedpred.ros.bag_reader import Bag, open_bag
from pedpred.ros.bag_topics import REMEDY, choose_map, choose_people
from pedpred.ros.decoding import Connection
from pedpred.ros.detections import DetectionFrame, find_usable
from pedpred.ros.frames import Transform
from pedpred.ros.identities import Identities
from pedpred.ros.message_types import TRANSFORMS, UPDATE_TYPE
from pedpred.ros.people import PEOPLE_FIELDS, parse_fields
from pedpred.ros.placing import place_people
from pedpred.ros.scene_messages import check_grid, map_of_grid, updated_grid
from pedpred.ros.tf import MAP_FRAME, Frames, frame_name
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.scenes.people import PERSON_CLASSES
from pedpred.tracking.tracks import LOST_AFTER_S

_TRANSFORM_TYPES = (TRANSFORMS, "tf/msg/tfMessage")
_SUFFIXES = (".zstd", ".zst")
_SHOWN_CLASSES = 5
_log = logging.getLogger(__name__)
_Warn = Callable[[str], object]


def read_bag(
    path: Path,
    topic: str | None = None,
    transform: Transform | None = None,
    map_topic: str | None = None,
    classes: Collection[str] = PERSON_CLASSES,
    names: dict[int, str] | None = None,
    fields: str | None = None,
    identities: str = "auto",
) -> Scene:
    """Read the people and the map of a bag.

    Times are the messages' stamps, or the bag's own where stamps are zero. People come into the map's frame
    or, without a map, into `map` or the topmost frame. Velocities in messages are not read.

    Detections without a position or a transform at their time, of other classes than people, and second ones
    of a track in one instant, are left out with a warning, and so are damaged messages.

    Args:
        path: a .bag, .db3 or .mcap file, or the folder of a ROS 2 bag.
        topic: of the people; optional where only one topic carries people.
        transform: of the people's frame, where it is not the map's; if it moves, of the topmost.
        map_topic: of the map; None: /map, or the only topic that is called map, or the only one that is
            neither a costmap nor predicted occupancy; "": the bag's maps are left out.
        classes: who is a person, where detections have classes.
        names: takes those of tracks whose numbers are not their names: number -> name.
        fields: those of people, of a type that is not known; see `pedpred.ros.people.parse_fields`.
        identities: how people are identified, see `pedpred.ros.identities.Identities`.

    Returns:
        The scene, named after the file. The last message of the map's topic counts, with the updates after
        it; without one the ground is free.

    Raises:
        InputError: the file is not a bag, no topic or several carry people, several carry a map, transforms
            or required ids are missing, stamps go back, or the messages make no scene.
        ValueRuleError: `fields` is not understood.
    """
    check_input(path)
    layout = None if fields is None else parse_fields(fields)
    problem = partial(InputError, path, None)
    with translate_errors(partial(problem, remedy=REMEDY)), open_bag(path) as bag:
        people = choose_people(path, bag.connections, topic, layout is not None)
        maps = choose_map(path, bag.connections, map_topic)
        source, kind = people[0].topic, people[0].msgtype
        layout = layout or PEOPLE_FIELDS[kind]
        if not layout.label and set(classes) != set(PERSON_CLASSES):
            text = f"{source} has no classes to choose from: it carries {kind}"
            raise InputError(path, None, text, "Leave --class out")
        warn = partial(_log.warning, "%s: %s: %s", path, source)
        with translate_errors(lambda text: problem(f"{source}: {text}", remedy="")):
            take = partial(DetectionFrame.from_message, fields=layout, classes=classes)
            grid, found = _read(bag, people, maps, take, warn)
            detections = _sort(_keep_people(found, warn), warn)
            map_frame = None if grid is None else frame_name(grid.header.frame_id)
            tree = _transforms(bag, {each.frame for each in detections} - {map_frame or MAP_FRAME})
            positions = place_people(detections, map_frame, tree, transform, warn)
            tracks = Identities(identities, bool(layout.id), recording=[each.ids for each in detections])
            trajectories = _trajectories(detections, positions, tracks, warn)
            if names is not None:
                names.update(tracks.names)
            dt_s = check(trajectories, str(path), any_speed=True)
            ground = OccupancyMap.free_around(trajectories.position) if grid is None else map_of_grid(grid)
    name = path.with_suffix("") if path.suffix in _SUFFIXES else path
    return Scene(name.stem, trajectories, ground, dt_s)


def _read(
    bag: Bag,
    people: Sequence[Connection],
    maps: Sequence[Connection],
    take: Callable[..., DetectionFrame],
    warn: _Warn,
) -> tuple[Any, list[DetectionFrame]]:
    """The last map with the updates after it, None where there is none, and all messages of people."""
    grid, wrong, detections = None, list[PedpredError](), list[DetectionFrame]()
    for connection, received_ns, message in bag.messages({*people, *maps}):
        if connection in people:
            detections.append(take(message, received_ns=received_ns))
            continue
        try:
            if connection.msgtype != UPDATE_TYPE:
                check_grid(message)
                grid = message
            elif grid is not None:
                grid = updated_grid(grid, message)
        except PedpredError as problem:
            wrong.append(problem)
    if wrong and grid is None:
        raise wrong[0]
    if wrong:
        warn(f"left out: {len(wrong)} messages of the map ({wrong[0]}); the map before stays")
    return grid, detections


def _keep_people(detections: Sequence[DetectionFrame], warn: _Warn) -> list[DetectionFrame]:
    """The messages that have people; warns of other classes.

    Raises:
        ValueRuleError: there are none.
    """
    others = Counter(label for each in detections for label in each.others)
    kept = [each for each in detections if each.ids]
    if not kept:
        rule = "no message has a detection of such a class: name the class of people (--class)"
        raise ValueRuleError("class", dict(others), rule)
    if others:
        shown = ", ".join(f"{count} of {label!r}" for label, count in others.most_common(_SHOWN_CLASSES))
        warn(f"left out: detections that are not people, {shown}")
    return kept


def _sort(detections: Sequence[DetectionFrame], warn: _Warn) -> list[DetectionFrame]:
    """The messages in order of time.

    Raises:
        ValueRuleError: stamps go back by more than a track may be lost.
    """
    if not any(each.is_stamped for each in detections):
        warn("no message has a stamp: the times are those of the bag")
    else:  # a simulation begins at 0
        detections = [each if each.is_stamped else replace(each, time_ns=0) for each in detections]
    time_s = np.array([each.time_s for each in detections])
    back = np.flatnonzero(np.maximum.accumulate(time_s) - time_s > LOST_AFTER_S)
    if len(back):
        rule = f"messages before number {back[0] + 1} are later: the recording restarts there, so split it"
        raise ValueRuleError("stamp", float(time_s[back[0]]), rule)
    return [detections[row] for row in np.argsort(time_s, kind="stable")]


def _transforms(bag: Bag, frames: Collection[str]) -> Frames:
    """All transforms of a bag; none if no frames need them."""
    tree = Frames()
    topics = [one for one in bag.connections if frames and one.msgtype in _TRANSFORM_TYPES]
    for connection, received_ns, message in bag.messages(topics) if topics else ():
        tree.add(message, received_ns / 1e9, fixed="static" in connection.topic)
    return tree


def _trajectories(
    detections: Sequence[DetectionFrame], positions: Sequence[np.ndarray], tracks: Identities, warn: _Warn
) -> Trajectories:
    """The tracks of all people, from messages in order of time and positions, m. [n, 2] each."""
    time_s = np.repeat([each.time_s for each in detections], [len(each.ids) for each in detections])
    pairs = zip(detections, positions, strict=True)
    track_id = np.concatenate([tracks.number(each.time_s, each.ids, here) for each, here in pairs])
    position = np.concatenate(positions)
    if tracks.unnamed:
        warn(f"{tracks.unnamed} of {len(track_id)} detections have no id: they are identified by position")
    usable, text = find_usable(time_s, track_id, position, tracks.name)
    if text:
        warn(text)
    return Trajectories(time_s[usable], track_id[usable], position[usable])
