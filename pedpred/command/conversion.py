"""`pedpred info` and `pedpred convert`: read a scene in any format, describe it, write it in another."""

from __future__ import annotations

import argparse
import logging
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from mcap.writer import MCAP0_MAGIC

from pedpred.command.maps import map_at
from pedpred.errors import SourceError, ValueRuleError
from pedpred.ros import Transform, is_bag, is_recording, read_bag, read_recording, write_recording
from pedpred.ros.foxglove import write_layout
from pedpred.scenes import OccupancyMap, Scene, checked_placement, placement
from pedpred.sources.beginnings import Beginning
from pedpred.sources.geometries import is_geometry, read_ground, read_walls
from pedpred.sources.plausibility import check_speeds
from pedpred.sources.scene_folder import read_own
from pedpred.sources.single_file import format_of, read_file
from pedpred.storage.scenes import write_scene
from pedpred.tables.classes import PERSON_CLASSES
from pedpred.tables.lines import titles_in
from pedpred.tables.names import TrackNames
from pedpred.tables.options import TableOptions
from pedpred.tables.pictures import read_homography

_MAP_BESIDE, _MOST_OUTSIDE = "map.yaml", 0.5

_FOR_FILES = {"--unit": "unit", "--scale": "pixel_m", "--rate": "rate_hz", "--columns": "columns"}
"""Options that have a meaning for files of tracks alone, and their fields of `TableOptions`."""

_log = logging.getLogger(__name__)
_OPTIONAL = ("velocity", "goal", "desired_speed_mps", "group_id", "person_id")


def info(arguments: argparse.Namespace) -> None:
    """Describe the content of a scene."""
    scene = read_given(arguments)
    trajectories, occupancy = scene.trajectories, scene.occupancy
    tracks, instants = (len(np.unique(values)) for values in (trajectories.track_id, trajectories.time_s))
    span_s = float(np.ptp(trajectories.time_s)) if len(trajectories) else 0.0
    known = [name for name in _OPTIONAL if getattr(trajectories, name) is not None]
    width, height = occupancy.extent_m
    lines = {
        "name": scene.name,
        "read as": _read_as(arguments),
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
    if _kind_of(arguments.scene) == "tracks":
        scene = replace(scene, name=arguments.output.stem)
    _log.info("%s: %s", scene.name, placement(scene.trajectories.position, scene.occupancy))
    if arguments.output.suffix == ".mcap":
        write_recording(scene, arguments.output)
        write_layout(scene.occupancy, set(), layout_of(arguments.output))
    else:
        write_scene(scene, arguments.output)


def read_given(arguments: argparse.Namespace, names: TrackNames | None = None) -> Scene:
    """Read the scene that the arguments name, on the map that they name; a misplaced map is warned about.

    Args:
        arguments: of the command line.
        names: takes those of tracks whose ids are words.

    Raises:
        ValueRuleError: open ends are given without a geometry file, or another option has no meaning.
    """
    replaced = arguments.map is not None or arguments.no_map
    ground = "" if replaced else arguments.map_topic
    transform = None if arguments.transform is None else Transform(*arguments.transform)
    classes, options = arguments.classes or PERSON_CLASSES, _options(arguments)
    if names is not None:
        options = replace(options, names=names)
    scene = read_any(arguments.scene, arguments.topic, options, transform, ground, classes)
    if ground := _ground_given(arguments):
        scene = replace(scene, occupancy=ground)
    elif not arguments.no_map and not scene.occupancy.occupied.any():
        scene = _on_map_beside(scene, arguments.scene)
    if arguments.no_map:
        scene = replace(scene, occupancy=OccupancyMap.free_around(scene.trajectories.position))
    checked_placement(scene)
    return scene


def warn_without_obstacles(scene: Scene, arguments: argparse.Namespace) -> None:
    """Say that forecasts will go through walls, unless the arguments say that there are none."""
    if not (scene.occupancy.occupied.any() or arguments.no_map):
        remedy = "Name a map with --map, or say --no-map"
        _log.warning("%s has no obstacles: forecasts go through walls. %s", scene.name, remedy)


def _options(arguments: argparse.Namespace) -> TableOptions:
    """What the arguments say about a file of tracks.

    Raises:
        ValueRuleError: a homography is given for something else than pixels.
    """
    columns = None if arguments.columns is None else tuple(titles_in(arguments.columns))
    classes = tuple(arguments.classes or ())
    with options_for_fields(_FOR_FILES):
        options = TableOptions(columns, arguments.rate, arguments.unit, arguments.scale, classes=classes)
    if arguments.homography is None:
        return options
    if _kind_of(arguments.scene) != "tracks" or not format_of(arguments.scene, options).pixels:
        rule = f"the positions in {arguments.scene} are not pixels"
        raise ValueRuleError("--homography", str(arguments.homography), rule)
    with options_for_fields(_FOR_FILES):
        return replace(options, homography=read_homography(arguments.homography))


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


def _read_as(arguments: argparse.Namespace) -> str:
    """The format as which the scene was read."""
    kind = _kind_of(arguments.scene)
    if kind == "tracks":
        return format_of(arguments.scene, _options(arguments)).name
    if kind == "recording" and arguments.topic is None:
        return "recording of pedpred"
    return "scene folder" if kind == "folder" else "ROS bag"


def _kind_of(path: Path) -> Literal["bag", "folder", "tracks", "recording"]:
    """What a path is: a bag, a scene folder, a file of tracks, or a recording of `write_recording`."""
    if is_bag(path):
        return "bag"
    if path.is_dir():
        return "folder"
    is_mcap = path.suffix == ".mcap" or (path.is_file() and Beginning.of(path).raw.startswith(MCAP0_MAGIC))
    if not is_mcap:
        return "tracks"
    return "recording" if is_recording(path) else "bag"


def _ground_given(arguments: argparse.Namespace) -> OccupancyMap | None:
    """The map that replaces that of the scene."""
    edges = [[end[:2], end[2:]] for end in arguments.open_end]
    if arguments.map is not None and is_geometry(arguments.map):
        return read_ground(arguments.map, read_walls(arguments.map), edges)
    inside = None
    if edges and arguments.map is None and _kind_of(arguments.scene) == "tracks":
        inside = format_of(arguments.scene, _options(arguments)).walls(arguments.scene)
    if inside is not None:
        return read_ground(arguments.scene, inside, edges)
    if edges:
        remedy = "it needs a geometry: --map walls.xml or .wkt, or a recording that has one"
        raise ValueRuleError("--open-end", arguments.open_end[0], remedy)
    return None if arguments.map is None else map_at(arguments.map)


def _on_map_beside(scene: Scene, path: Path) -> Scene:
    """A scene without obstacles, on the map of the map.yaml beside its file if there is one."""
    beside = path.with_name(_MAP_BESIDE)
    if _kind_of(path) != "tracks" or not beside.exists():
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
        SourceError: it is not.
    """
    if path.is_dir() and not any((path / name).exists() for name in ("scene.json", "tracks.parquet")):
        files = sorted(file.name for file in path.iterdir() if file.is_file() and file.name[0] != ".")
        remedy = f"Name one of its files, such as {path / files[0]}" if files else "It holds no files"
        raise SourceError(path, None, "a folder with no scene and no bag", remedy)


def read_any(
    path: Path,
    topic: str | None = None,
    options: TableOptions | None = None,
    transform: Transform | None = None,
    map_topic: str | None = None,
    classes: Sequence[str] = PERSON_CLASSES,
) -> Scene:
    """Read a scene folder, a file of tracks, a recording or a ROS bag.

    Args:
        path: what a file begins with determines the format, the name that of bags.
        topic: of a bag's people; a recording of this project is read as a bag if one is given.
        options: what a file of tracks does not say itself; takes the names of tracks.
        transform: of the people's frame, where it is not the map's.
        map_topic: of a bag's map, see `read_bag`; "" leaves out the geometry inside other files, too.
        classes: of people among a bag's detections, see `read_bag`.

    Raises:
        StorageError, SourceError: the file is missing, damaged or of another format.
        ValueRuleError: an option has no meaning for the format.
    """
    options, kind = options or TableOptions(), _kind_of(path)
    if kind in ("tracks", "folder"):
        for name, value in {"--topic": topic, "--map-topic": map_topic}.items():
            if value:
                raise ValueRuleError(name, value, f"{path} is no bag: it has no topics")
    if kind == "tracks":
        scene = read_file(path, options, with_walls=map_topic != "")
    elif surplus := [name for name, field in _FOR_FILES.items() if getattr(options, field, None) is not None]:
        value = getattr(options, _FOR_FILES[surplus[0]])
        raise ValueRuleError(
            surplus[0], value, f"{path} says times and lengths itself; it is for tables and texts"
        )
    elif kind == "bag" or (kind == "recording" and (topic is not None or map_topic is not None)):
        return read_bag(path, topic, transform, map_topic, classes, options.names.of_number)
    else:
        _check_folder(path)
        if options.classes:
            raise ValueRuleError("--class", options.classes, f"{path} is a scene: all in it are people")
        scene = read_own(path, options) if kind == "folder" else read_recording(path, transform)
        check_speeds(path, scene.trajectories, sure=True, fixed="m")
        transform = transform if kind == "folder" else None
    if transform is None:
        return scene
    people = transform.moved(scene.trajectories)
    is_free = not scene.occupancy.occupied.any() and kind == "tracks"
    return replace(
        scene,
        trajectories=people,
        occupancy=OccupancyMap.free_around(people.position) if is_free else scene.occupancy,
    )
