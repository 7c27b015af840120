"""`pedpred info` and `pedpred convert`: read a scene in any format, describe it, write it in another."""

from __future__ import annotations

import argparse
import logging
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from mcap.writer import MCAP0_MAGIC

from pedpred.command.maps import map_at
from pedpred.errors import InputError, ValueRuleError
from pedpred.reading import Recording, read_recording
from pedpred.reading.checks import check_speeds
from pedpred.reading.geometry import is_geometry, read_ground, read_walls
from pedpred.reading.head import Head
from pedpred.reading.names import TrackNames
from pedpred.reading.options import ReadOptions
from pedpred.reading.pixels import read_homography
from pedpred.ros import Transform, is_bag, is_recording, read_bag, write_recording
from pedpred.ros import read_recording as read_mcap
from pedpred.ros.foxglove import write_layout
from pedpred.scenes import OccupancyMap, Scene, checked_placement, placement
from pedpred.scenes.people import PERSON_CLASSES
from pedpred.sources.scene_folder import read_own
from pedpred.storage.scenes import write_scene

_MAP_BESIDE, _MOST_OUTSIDE = "map.yaml", 0.5

_OPTIONS = {
    "columns": "--columns",
    "rate_hz": "--rate",
    "unit": "--unit",
    "pixel_m": "--scale",
    "homography": "--homography",
    "delimiter": "--delimiter",
    "decimal": "--decimal",
    "encoding": "--encoding",
    "one_person_per_file": "--one-person-per-file",
}
"""Fields of `ReadOptions` that have a meaning for files of tracks alone, and the options that set them."""

_log = logging.getLogger(__name__)
_OPTIONAL = ("velocity", "goal", "desired_speed_mps", "group_id", "person_id")


def info(arguments: argparse.Namespace) -> None:
    """Describe the content of a scene."""
    recording = open_given(arguments)
    scene, trajectories, occupancy = recording.scene, recording.scene.trajectories, recording.scene.occupancy
    tracks, instants = (len(np.unique(values)) for values in (trajectories.track_id, trajectories.time_s))
    span_s = float(np.ptp(trajectories.time_s)) if len(trajectories) else 0.0
    known = [name for name in _OPTIONAL if getattr(trajectories, name) is not None]
    width, height = occupancy.extent_m
    lines = {
        "name": scene.name,
        "read as": recording.format,
        "detections": f"{len(trajectories)} of {tracks} tracks, {instants} instants",
        "duration": f"{span_s:.1f} s, usually {scene.detection_dt_s:.3g} s between two detections",
        "map": f"{width:.1f} m x {height:.1f} m, cells of {occupancy.resolution_m:g} m, "
        f"{100 * occupancy.occupied.mean():.1f} % occupied"
        if occupancy.occupied.any()
        else "no obstacles are known",
        "on the map": str(placement(trajectories.position, occupancy)),
        "also known": ", ".join(known) or "nothing",
        "camera": "yes" if scene.camera else "no",
    }
    sys.stdout.writelines(f"{key:>12}  {value}\n" for key, value in lines.items())


def convert(arguments: argparse.Namespace) -> None:
    """Write a scene as MCAP (a name that ends in .mcap) or as a scene folder."""
    if arguments.output.suffix not in ("", ".mcap"):
        raise ValueRuleError(
            "output", str(arguments.output), "a name ends in .mcap, or has no dot, as that of a scene folder"
        )
    scene = read_given(arguments)
    if _kind_of(arguments.scene, arguments.one_person_per_file) == "tracks":
        scene = replace(scene, name=arguments.output.stem)
    _log.info("%s: %s", scene.name, placement(scene.trajectories.position, scene.occupancy))
    if arguments.output.suffix == ".mcap":
        write_recording(scene, arguments.output)
        write_layout(scene.occupancy, set(), layout_of(arguments.output))
    else:
        write_scene(scene, arguments.output)


def read_given(arguments: argparse.Namespace, names: TrackNames | None = None) -> Scene:
    """Read the scene that the arguments name; see `open_given`.

    Args:
        arguments: of the command line.
        names: takes those of tracks whose ids are words.
    """
    recording = open_given(arguments)
    if names is not None:
        names.of_number.update(recording.names.of_number)
    return recording.scene


def open_given(arguments: argparse.Namespace) -> Recording:
    """Read what the arguments name, on the map that they name; a misplaced map is warned about.

    Raises:
        ValueRuleError: open ends are given without a geometry file, or another option has no meaning.
    """
    replaced = arguments.map is not None or arguments.no_map
    transform = None if arguments.transform is None else Transform(*arguments.transform)
    map_topic = "" if replaced else arguments.map_topic
    recording = _open(arguments.scene, arguments.topic, _options(arguments), transform, map_topic)
    scene = recording.scene
    if ground := _ground_given(arguments, recording):
        scene = replace(scene, occupancy=ground)
    elif not arguments.no_map and not scene.occupancy.occupied.any():
        scene = _on_map_beside(scene, arguments.scene)
    if arguments.no_map:
        scene = replace(scene, occupancy=OccupancyMap.free_around(scene.trajectories.position))
    checked_placement(scene)
    return replace(recording, scene=scene)


def warn_without_obstacles(scene: Scene, arguments: argparse.Namespace) -> None:
    """Say that forecasts will go through walls, unless the arguments say that there are none."""
    if not (scene.occupancy.occupied.any() or arguments.no_map):
        remedy = "Name a map with --map, or say --no-map"
        _log.warning("%s has no obstacles: forecasts go through walls. %s", scene.name, remedy)


def _options(arguments: argparse.Namespace) -> ReadOptions:
    """What the arguments say about a recording."""
    with options_for_fields({option: field for field, option in _OPTIONS.items()}):
        options = ReadOptions(
            columns=_columns(arguments.columns),
            rate_hz=arguments.rate,
            unit=arguments.unit,
            pixel_m=arguments.scale,
            classes=tuple(arguments.classes or ()),
            delimiter=arguments.delimiter,
            decimal=arguments.decimal,
            encoding=arguments.encoding,
            any_speed=arguments.any_speed,
            one_person_per_file=arguments.one_person_per_file,
        )
        if arguments.homography is None:
            return options
        return replace(options, homography=read_homography(arguments.homography))


def _columns(text: str | None) -> Mapping[str, str] | tuple[str, ...] | None:
    """The columns in `time=t_ros,id=agent` (by title) or `frame,id,x,y` (by position)."""
    if text is None:
        return None
    parts = [part.strip() for part in text.split(",")]
    if not any("=" in part for part in parts):
        return tuple(parts)
    pairs = [part.partition("=") for part in parts]
    return {quantity.strip(): title.strip() for quantity, _, title in pairs}


@contextmanager
def options_for_fields(options: Mapping[str, str]) -> Iterator[None]:
    """Let an error about a field name the option that was given.

    Args:
        options: name of an option -> its field.
    """
    try:
        yield
    except ValueRuleError as cause:
        option = next((option for option, field in options.items() if field == cause.field), cause.field)
        raise ValueRuleError(option, cause.value, cause.rule) from cause


def _kind_of(
    path: Path, one_person_per_file: bool = False
) -> Literal["bag", "folder", "tracks", "recording"]:
    """What a path is: a bag, a scene folder, a file of tracks, or a recording of `write_recording`."""
    if one_person_per_file:
        return "tracks"
    if is_bag(path):
        return "bag"
    if path.is_dir():
        return "folder"
    is_mcap = path.suffix == ".mcap" or (path.is_file() and Head.of(path).raw.startswith(MCAP0_MAGIC))
    if not is_mcap:
        return "tracks"
    return "recording" if is_recording(path) else "bag"


def _ground_given(arguments: argparse.Namespace, recording: Recording) -> OccupancyMap | None:
    """The map that replaces that of the scene."""
    edges = [[end[:2], end[2:]] for end in arguments.open_end]
    if arguments.map is not None and is_geometry(arguments.map):
        return read_ground(arguments.map, read_walls(arguments.map), edges)
    if edges and arguments.map is None and recording.walls is not None:
        return read_ground(arguments.scene, recording.walls, edges)
    if edges:
        remedy = "it needs a geometry: --map walls.xml or .wkt, or a recording that has one"
        raise ValueRuleError("--open-end", arguments.open_end[0], remedy)
    return None if arguments.map is None else map_at(arguments.map)


def _on_map_beside(scene: Scene, path: Path) -> Scene:
    """A scene without obstacles, on the map of the map.yaml beside its file if there is one."""
    beside = path.with_name(_MAP_BESIDE)
    if path.is_dir() or _kind_of(path) != "tracks" or not beside.exists():
        return scene
    ground = map_at(beside)
    if placement(scene.trajectories.position, ground).outside > _MOST_OUTSIDE:
        _log.warning("%s beside %s is not used: the people are elsewhere", beside, path.name)
        return scene
    _log.info("%s has no obstacles: %s beside it is used; --no-map leaves it out", path.name, beside)
    return replace(scene, occupancy=ground)


def stem_of(path: Path) -> str:
    """What an output is called after an input; `.` and `..` are called as the folders are."""
    return Path(os.path.abspath(path)).stem  # without following links


def layout_of(recording: Path) -> Path:
    """Path of the layout for Foxglove that is written beside a recording."""
    return recording.with_suffix(".foxglove.json")


def written_to(path: Path) -> list[Path]:
    """What is written for an output: a layout for Foxglove beside a recording, too."""
    return [path, layout_of(path)] if path.suffix == ".mcap" else [path]


def refuse_overwriting(path: Path, force: bool) -> None:
    """End the command if something is there that would be written, and `--force` is not given."""
    for output in written_to(path):
        if (output.exists() or output.is_symlink()) and not force:
            sys.exit(f"{output} is there already; --force replaces it")


def _check_folder(path: Path) -> None:
    """Check that a folder is a scene, not one in which recordings lie.

    Raises:
        InputError: it is not.
    """
    if path.is_dir() and not any((path / name).exists() for name in ("scene.json", "tracks.parquet")):
        files = sorted(file.name for file in path.iterdir() if file.is_file() and file.name[0] != ".")
        remedy = (
            f"Name one of its files, such as {path / files[0]}, or say --one-person-per-file"
            if files
            else "It holds no files"
        )
        raise InputError(path, None, "a folder with no scene and no bag", remedy)


def read_any(
    path: Path,
    topic: str | None = None,
    options: ReadOptions | None = None,
    transform: Transform | None = None,
    map_topic: str | None = None,
) -> Scene:
    """Read a scene folder, a file of tracks, a recording or a ROS bag.

    Args:
        path: what a file begins with determines the format, the name that of bags.
        topic: of a bag's people; a recording of this project is read as a bag if one is given.
        options: what a file of tracks does not say itself.
        transform: of the people's frame, where it is not the map's.
        map_topic: of a bag's map, see `read_bag`; "" leaves out the geometry inside other files, too.

    Raises:
        InputError, InputError: the file is missing, damaged or of another format.
        ValueRuleError: an option has no meaning for the format.
    """
    return _open(path, topic, options or ReadOptions(), transform, map_topic).scene


def _open(
    path: Path, topic: str | None, options: ReadOptions, transform: Transform | None, map_topic: str | None
) -> Recording:
    """Read a scene folder, a file of tracks, a recording or a ROS bag; see `read_any`."""
    kind = _kind_of(path, options.one_person_per_file)
    if kind in ("tracks", "folder"):
        for name, value in {"--topic": topic, "--map-topic": map_topic}.items():
            if value:
                raise ValueRuleError(name, value, f"{path} is no bag: it has no topics")
    if kind == "tracks":
        return _moved(read_recording(path, options, with_walls=map_topic != ""), transform)
    for field, option in _OPTIONS.items():
        if (value := getattr(options, field)) != getattr(ReadOptions(), field):
            raise ValueRuleError(option, value, f"{path} says it itself; it is for files of tracks")
    names = TrackNames()
    if kind == "bag" or (kind == "recording" and (topic is not None or map_topic is not None)):
        classes = options.classes or PERSON_CLASSES
        scene = read_bag(path, topic, transform, map_topic, classes, names.of_number)
        return Recording(scene, names, "ROS bag")
    _check_folder(path)
    if options.classes:
        raise ValueRuleError("--class", options.classes, f"{path} is a scene: all in it are people")
    scene = read_own(path, names) if kind == "folder" else read_mcap(path, transform)
    check_speeds(str(path), scene.trajectories, any_speed=True)
    if kind == "recording":
        return Recording(scene, names, "recording of pedpred")
    return _moved(Recording(scene, names, "scene folder"), transform)


def _moved(recording: Recording, transform: Transform | None) -> Recording:
    """The people in the frame of the map; free ground moves with them."""
    if transform is None:
        return recording
    scene = recording.scene
    people = transform.moved(scene.trajectories)
    is_free = not scene.occupancy.occupied.any() and recording.format != "scene folder"
    ground = OccupancyMap.free_around(people.position) if is_free else scene.occupancy
    return replace(recording, scene=replace(scene, trajectories=people, occupancy=ground))
