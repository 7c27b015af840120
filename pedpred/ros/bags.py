"""Bags of ROS 1 (.bag) and ROS 2 (a folder, a single .mcap or .db3), without ROS."""

from __future__ import annotations

import logging
import re
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.errors import InputError, PedpredError, ValueRuleError
from pedpred.files import check_input, translate_errors
from pedpred.reading.checks import check_interval, check_speeds
from pedpred.ros.bag_reader import Bag, open_bag
from pedpred.ros.bag_topics import REMEDY, choose_map, choose_people
from pedpred.ros.decoding import Connection
from pedpred.ros.detections import DetectionFrame, find_usable
from pedpred.ros.frames import Transform, check_frames
from pedpred.ros.identities import Identities
from pedpred.ros.message_types import TRANSFORMS, UPDATE_TYPE
from pedpred.ros.people import PEOPLE_FIELDS, parse_fields
from pedpred.ros.scene_messages import check_grid, map_of_grid, updated_grid
from pedpred.ros.tf import MAP_FRAME, Frames, frame_name, is_robot_base
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.scenes.people import PERSON_CLASSES
from pedpred.tracking.tracks import LOST_AFTER_S

_TRANSFORM_TYPES = (TRANSFORMS, "tf/msg/tfMessage")
_TF_REMEDY = "record /tf and /tf_static up to the frame of the map, too"
_SENSOR = re.compile(r"base_|_link|laser|lidar|velodyne|ouster|livox|camera|scan|realsense|zed")
"""In names of frames that robots carry, mostly."""
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
            or wanted ids are missing, stamps go back, or the messages make no scene.
        ValueRuleError: `fields` is not understood.
    """
    check_input(path)
    known = None if fields is None else parse_fields(fields)
    problem = partial(InputError, path, None)
    with translate_errors(partial(problem, remedy=REMEDY)), open_bag(path) as bag:
        sources = choose_people(path, bag.connections, topic, known is not None)
        maps = choose_map(path, bag.connections, map_topic)
        people, kind = sources[0].topic, sources[0].msgtype
        known = known or PEOPLE_FIELDS[kind]
        if not known.label and set(classes) != set(PERSON_CLASSES):
            lack = f"{people} has no classes to choose from: it carries {kind}"
            raise InputError(path, None, lack, "Leave --class out")
        warn = partial(_log.warning, "%s: %s: %s", path, people)
        with translate_errors(lambda lack: problem(f"{people}: {lack}", remedy="")):
            take = partial(DetectionFrame.from_message, fields=known, classes=classes)
            grid, frames = _read(bag, sources, maps, take, warn)
            frames = _sort(_keep_people(frames, warn), warn)
            map_frame = None if grid is None else frame_name(grid.header.frame_id)
            is_placed = {each.frame for each in frames} <= {map_frame or MAP_FRAME}
            tree = Frames() if is_placed else _transforms(bag)
            targets = _targets(frames, map_frame, transform, tree, warn)
            places = _place(frames, targets, transform, tree, warn)
            tracks = Identities(identities, bool(known.id), recording=[each.ids for each in frames])
            trajectories = _trajectories(frames, places, tracks, warn)
            if names is not None:
                names.update(tracks.names)
            dt_s = trajectories.usual_interval_s()
            check_interval(dt_s)
            check_speeds(str(path), trajectories, any_speed=True)
            ground = OccupancyMap.free_around(trajectories.position) if grid is None else map_of_grid(grid)
            name = path.with_suffix("") if path.suffix in _SUFFIXES else path
            return Scene(name.stem, trajectories, ground, dt_s)


def _read(
    bag: Bag,
    sources: Sequence[Connection],
    maps: Sequence[Connection],
    take: Callable[..., DetectionFrame],
    warn: _Warn,
) -> tuple[Any, list[DetectionFrame]]:
    """The last map with the updates after it, None where there is none, and all messages of people."""
    grid, wrong, frames = None, list[PedpredError](), list[DetectionFrame]()
    for connection, received_ns, message in bag.messages({*sources, *maps}):
        if connection in sources:
            frames.append(take(message, received_ns=received_ns))
            continue
        try:
            grid = _changed(grid, message, connection.msgtype == UPDATE_TYPE)
        except PedpredError as problem:
            wrong.append(problem)
    if wrong and grid is None:
        raise wrong[0]
    if wrong:
        warn(f"left out: {len(wrong)} messages of the map ({wrong[0]}); the map before stays")
    return grid, frames


def _changed(grid: Any, message: Any, is_update: bool) -> Any:
    """The map after a message; without a map before, an update is left out."""
    if is_update:
        return None if grid is None else updated_grid(grid, message)
    check_grid(message)
    return message


def _keep_people(frames: Sequence[DetectionFrame], warn: _Warn) -> list[DetectionFrame]:
    """The messages that have people; warns of other classes.

    Raises:
        ValueRuleError: there are none.
    """
    others = Counter(label for each in frames for label in each.others)
    kept = [each for each in frames if each.ids]
    if not kept:
        rule = "no message has a detection of such a class: name the class of people (--class)"
        raise ValueRuleError("class", dict(others), rule)
    if others:
        shown = ", ".join(f"{count} of {label!r}" for label, count in others.most_common(_SHOWN_CLASSES))
        warn(f"left out: detections that are not people, {shown}")
    return kept


def _sort(frames: Sequence[DetectionFrame], warn: _Warn) -> list[DetectionFrame]:
    """The messages in order of time.

    Raises:
        ValueRuleError: stamps go back by more than a track may be lost.
    """
    if not any(each.is_stamped for each in frames):
        warn("no message has a stamp: the times are those of the bag")
    else:  # a simulation begins at 0
        frames = [each if each.is_stamped else replace(each, time_ns=0) for each in frames]
    time_s = np.array([each.time_s for each in frames])
    back = np.flatnonzero(np.maximum.accumulate(time_s) - time_s > LOST_AFTER_S)
    if len(back):
        rule = f"messages before number {back[0] + 1} are later: the recording restarts there, so split it"
        raise ValueRuleError("stamp", float(time_s[back[0]]), rule)
    return [frames[row] for row in np.argsort(time_s, kind="stable")]


def _targets(
    frames: Sequence[DetectionFrame], grid: str | None, transform: Transform | None, tree: Frames, warn: _Warn
) -> dict[str, str]:
    """The frame into which people of each frame are brought; see `_target`.

    Args:
        frames: of people.
        grid: the map's frame; None without a map.
        transform: of the people's frame in the map's; of a frame that moves, of the topmost one.
        tree: all transforms, if there are people in another frame.
        warn: gets a text where a sensor's frame has no transforms.

    Raises:
        ValueRuleError: people and map are in different frames, and how they lie is unknown, or z is not the
            height.
    """
    targets = {name: _target(name, grid, tree, transform) for name in {each.frame for each in frames}}
    for name, target in targets.items():
        if "optical" in target:
            rule = f"z of an optical frame looks forward, not up: {_TF_REMEDY}"
            raise ValueRuleError("frame_id", target, rule)
        if target != grid and transform is None and _SENSOR.search(target):
            warn(f"people are in {name!r}, without transforms: if it moves, {_TF_REMEDY}")
    check_frames(set(targets.values()), grid, transform)
    return targets


def _place(
    frames: Sequence[DetectionFrame],
    targets: Mapping[str, str],
    transform: Transform | None,
    tree: Frames,
    warn: _Warn,
) -> list[np.ndarray]:
    """The places of each message in the frame of the map, m; NaN where a transform is missing. [n, 2] each.

    Raises:
        ValueRuleError: transforms are missing at all times.
    """
    counts = [len(each.ids) for each in frames]
    points = np.concatenate([each.places for each in frames])
    time_s = np.repeat([each.time_s for each in frames], counts)
    for name, target in targets.items():
        rows = np.flatnonzero(np.repeat([each.frame == name for each in frames], counts))
        if name == target:
            continue
        moved = tree.placed(points[rows], time_s[rows], name, target)
        lost = np.isnan(moved).any(axis=1)
        if lost.all():
            rule = tree.lack(name, target, float(time_s[rows][0]))
            raise ValueRuleError("transform", f"none at {time_s[rows][0]} s", f"{rule}: {_TF_REMEDY}")
        if lost.any():
            text = f"{lost.sum()} of {len(lost)} detections, without /tf from {name!r} to {target!r}"
            warn(f"left out: {text}, the first at {time_s[rows][lost][0]} s")
        points[rows] = moved
    placed = points[:, :2] if transform is None else transform.to_map(points[:, :2])
    return np.split(placed, np.cumsum(counts)[:-1])


def _target(frame: str, grid: str | None, tree: Frames, transform: Transform | None) -> str:
    """The frame into which people are brought: the map's, or the topmost one where that is unknown.

    Raises:
        ValueRuleError: people are in a robot's frame, and nothing says where that is in the map's; or in one
            that moves, and a fixed transform is given.
    """
    above = tree.chain(frame)
    reached = grid is not None and tree.chain(grid)[-1] == above[-1]
    if transform is not None:
        if reached and tree.moves(frame):
            rule = f"{frame!r} moves, as /tf says, and /tf leads to {grid!r}: leave --transform out"
            raise ValueRuleError("transform", vars(transform), rule)
        return above[-1] if tree.moves(frame) else frame
    if reached:
        return str(grid)
    if grid is None:
        return MAP_FRAME if MAP_FRAME in above else above[-1]
    if tree.moves(frame) or is_robot_base(above[-1]):
        frames = f"people in {frame!r}, which /tf brings to {above[-1]!r}, map in {grid!r}"
        rule = f"nothing says how these lie: {_TF_REMEDY}, or leave the bag's maps out (--map-topic '')"
        raise ValueRuleError("frame_id", frames, rule)
    return frame


def _transforms(bag: Bag) -> Frames:
    """All transforms of a bag."""
    tree = Frames()
    topics = [one for one in bag.connections if one.msgtype in _TRANSFORM_TYPES]
    for connection, received_ns, message in bag.messages(topics) if topics else ():
        tree.add(message, received_ns / 1e9, fixed="static" in connection.topic)
    return tree


def _trajectories(
    frames: Sequence[DetectionFrame], places: Sequence[np.ndarray], tracks: Identities, warn: _Warn
) -> Trajectories:
    """The tracks of all people, from messages in order of time and places, m. [n, 2] each."""
    time_s = np.repeat([each.time_s for each in frames], [len(each.ids) for each in frames])
    numbers = [tracks.number(each.time_s, each.ids, at) for each, at in zip(frames, places, strict=True)]
    track_id = np.concatenate([np.zeros(0, np.int64), *numbers])
    position = np.concatenate([np.zeros((0, 2)), *places])
    if tracks.unnamed:
        warn(f"{tracks.unnamed} of {len(track_id)} detections have no id: they are identified by position")
    kept, lack = find_usable(time_s, track_id, position, tracks.name)
    if lack:
        warn(lack)
    return Trajectories(time_s[kept], track_id[kept], position[kept])
