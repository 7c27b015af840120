"""Open a recording of any kind, on the map that belongs to it."""

from __future__ import annotations

import logging
from collections.abc import Set
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from mcap.writer import MCAP0_MAGIC

from pedpred.errors import InputError, ValueRuleError
from pedpred.files import check_input
from pedpred.reading import Recording, read_recording
from pedpred.reading.checks import check
from pedpred.reading.errors import add_path
from pedpred.reading.geometry import is_geometry, read_ground, read_walls
from pedpred.reading.head import Head
from pedpred.reading.names import TrackNames
from pedpred.reading.options import ReadOptions
from pedpred.ros import Transform, is_bag, read_bag
from pedpred.ros.identities import MODES
from pedpred.scenes import OccupancyMap, Scene, checked_placement, placement
from pedpred.scenes.people import PERSON_CLASSES
from pedpred.settings import check_choice
from pedpred.sources.scene_folder import read_own
from pedpred.storage.maps import read_map

_MOST_OUTSIDE = 0.5
_OF_EVERY_KIND = ("transform", "map", "no_map", "open_ends")
_log = logging.getLogger(__name__)

Edge = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class OpenOptions:
    """What a recording does not contain itself.

    Attributes:
        file: about files of tracks, and classes of people.
        topic: of the people in a bag; None: the only one that carries people.
        map_topic: of the map in a bag, see `read_bag`; "": the bag's maps are left out.
        people: fields of the people in messages of a bag whose type is not known, see `read_bag`.
        identities: how people in a bag are identified, see `read_bag`.
        transform: pose of the people's frame in the map's frame, where the two differ.
        map: of a map or geometry that replaces that of the recording.
        no_map: leave out all maps: the ground is free.
        open_ends: edges of a geometry's outline beyond which the ground continues.
    """

    file: ReadOptions = field(default_factory=ReadOptions)
    topic: str | None = None
    map_topic: str | None = None
    people: str | None = None
    identities: str = MODES[0]
    transform: Transform | None = None
    map: Path | None = None
    no_map: bool = False
    open_ends: tuple[Edge, ...] = ()

    def __post_init__(self) -> None:
        check_choice("identities", self.identities, MODES)
        for name in ("map", "map_topic", "open_ends") if self.no_map else ():
            if value := getattr(self, name):
                raise ValueRuleError(name, value, "--no-map (no_map) leaves every map out: omit one of them")


OPEN_FIELDS = tuple(one.name for one in (*fields(OpenOptions), *fields(ReadOptions)) if one.name != "file")
"""Fields of `OpenOptions` and of its `file`."""


def open_scene(path: Path, options: OpenOptions | None = None) -> Scene:
    """Read the scene of a recording; see `open_recording`."""
    return open_recording(path, options).scene


def open_recording(path: Path, options: OpenOptions | None = None) -> Recording:
    """Read a scene folder, a file of tracks or a ROS bag; a warning says if the map seems misplaced.

    Args:
        path: the content of a file determines its format, the name that of bags.
        options: what it does not contain itself.

    Raises:
        InputError: the file is missing, damaged or of another format.
        ValueRuleError: an option is given that this kind of recording does not use.
    """
    options = options or OpenOptions()
    check_input(path)
    if not options.file.one_person_per_file and _is_bag(path):
        _check_unused(f"{path} is a ROS bag", options.file, ReadOptions(), {"classes", "any_speed"})
        recording = _read_bag(path, options)
    else:
        _check_unused(f"{path} is no ROS bag", options, OpenOptions(), {"file", *_OF_EVERY_KIND})
        if path.is_dir() and not options.file.one_person_per_file:
            _check_unused(f"{path} is a scene folder", options.file, ReadOptions(), {"any_speed"})
            recording = _read_folder(path)
        else:
            has_map = options.map is not None or options.no_map
            recording = read_recording(path, options.file, with_walls=not has_map)
        recording = _move(recording, options.transform)
    scene = replace(recording.scene, occupancy=_ground_of(path, options, recording))
    checked_placement(scene)
    return replace(recording, scene=scene)


def _is_bag(path: Path) -> bool:
    if is_bag(path) or path.suffix == ".mcap":
        return True
    return not path.is_dir() and Head.of(path).raw.startswith(MCAP0_MAGIC)


def _check_unused(kind: str, options: Any, usual: Any, used: Set[str]) -> None:
    """Refuse options that a kind of recordings does not use."""
    for name, value in vars(options).items():
        if name not in used and value != getattr(usual, name):
            raise ValueRuleError(name, value, f"{kind}, which does not use it: omit it")


def _read_folder(path: Path) -> Recording:
    if not any((path / name).exists() for name in ("scene.json", "tracks.parquet")):
        remedy = "Name one of the files in it, or read all of them with --one-person-per-file"
        raise InputError(path, None, "a folder with no scene and no bag", remedy)
    names = TrackNames()
    scene = read_own(path, names)
    with add_path(path):
        check(scene.trajectories, str(path), any_speed=True)
    return Recording(scene, names, "scene folder")


def _read_bag(path: Path, options: OpenOptions) -> Recording:
    names = TrackNames()
    map_topic = "" if options.map is not None or options.no_map else options.map_topic
    classes = options.file.classes or PERSON_CLASSES
    topics = (options.topic, options.transform, map_topic)
    scene = read_bag(path, *topics, classes, names.of_number, options.people, options.identities)
    return Recording(scene, names, "ROS bag")


def _move(recording: Recording, transform: Transform | None) -> Recording:
    """The people in the frame of the map; ground without obstacles moves with them."""
    if transform is None:
        return recording
    scene, people = recording.scene, transform.moved(recording.scene.trajectories)
    has_map = scene.occupancy.occupied.any()
    ground = scene.occupancy if has_map else OccupancyMap.free_around(people.position)
    return replace(recording, scene=replace(scene, trajectories=people, occupancy=ground))


def _ground_of(path: Path, options: OpenOptions, recording: Recording) -> OccupancyMap:
    """The map that the options name, or that of the recording, or the map.yaml beside a file of tracks."""
    position, own = recording.scene.trajectories.position, recording.scene.occupancy
    if options.no_map:
        return OccupancyMap.free_around(position)
    if options.map is not None:
        return read_ground_at(options.map, options.open_ends)
    if options.open_ends:
        if recording.walls is None:
            rule = "it needs a geometry: --map walls.xml or .wkt, or a recording that has one"
            raise ValueRuleError("open_ends", options.open_ends, rule)
        return read_ground(path, recording.walls, options.open_ends)
    beside = path.with_name("map.yaml")
    if own.occupied.any() or _is_bag(path) or path.is_dir() or not beside.exists():
        return own
    ground = read_map(beside)
    if placement(position, ground).outside > _MOST_OUTSIDE:
        _log.warning("%s beside %s is not used: the people are elsewhere", beside, path.name)
        return own
    _log.info("%s has no obstacles: %s beside it is used; --no-map leaves it out", path.name, beside)
    return ground


def read_ground_at(path: Path, open_ends: tuple[Edge, ...] = ()) -> OccupancyMap:
    """Read a map or a geometry.

    Args:
        path: of a geometry, or see `read_map`.
        open_ends: edges of the geometry's outline beyond which the ground continues.

    Raises:
        InputError: a file is missing or damaged.
        ValueRuleError: a map has no outline whose ends could be open.
    """
    check_input(path)
    if is_geometry(path):
        return read_ground(path, read_walls(path), open_ends)
    if open_ends:
        raise ValueRuleError("open_ends", open_ends, f"{path} is no geometry (.xml, .wkt), which they need")
    return read_map(path)


def warn_without_obstacles(scene: Scene, options: OpenOptions) -> None:
    """Warn that forecasts will go through walls, unless the options say that there are none."""
    if not (scene.occupancy.occupied.any() or options.no_map):
        remedy = "Name a map with --map, or say --no-map"
        _log.warning("%s has no obstacles: forecasts go through walls. %s", scene.name, remedy)
