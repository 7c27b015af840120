"""Bags of ROS 1 (.bag) and ROS 2 (a folder with metadata.yaml, a single .mcap or .db3), without ROS."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader

from pedpred.errors import SourceError, brief
from pedpred.files import read_yaml, translate_errors
from pedpred.ros.frames import Transform, check_frames
from pedpred.ros.mcap_reader import McapReader
from pedpred.ros.message_types import MAP, TYPES, known_types
from pedpred.ros.people import ADAPTERS, TrackNumbers, find_usable
from pedpred.ros.scene_messages import map_of_grid, seconds
from pedpred.ros.unpacking import bound_unpacking, check_tables
from pedpred.scenes import OccupancyMap, Scene, Trajectories

_log = logging.getLogger(__name__)
_GRID = TYPES[MAP]
_REMEDY = f"A bag may hold {', '.join(sorted(ADAPTERS))} for people and {_GRID} for the map"
_MAP_REMEDY = "Choose one: --map-topic"
_NO_MAP = re.compile(r"costmap|^/predicted_occupancy/")
"""Topics of grids that are no map: costs for planners, and where people are going to be."""
_MCAP_REMEDY = "Record it with `ros2 bag record`, or repair it with the `mcap` command line tool"


def is_bag(path: Path) -> bool:
    """Whether the name is that of a bag; an .mcap file may be a bag or a recording of `write_recording`."""
    return path.suffix in (".bag", ".db3") or (path / "metadata.yaml").exists()


def read_bag(
    path: Path, topic: str | None = None, transform: Transform | None = None, map_topic: str | None = None
) -> Scene:
    """Read the people and the map of a bag.

    Times are the messages' stamps, or the bag's own where all stamps are zero.

    Detections without a place, and second ones of a track in one instant, are left out with a warning.

    Args:
        path: a .bag, .db3 or .mcap file, or the folder of a ROS 2 bag.
        topic: of the people; optional where only one topic carries people.
        transform: of the people's frame, where it is not the map's.
        map_topic: of the map; None: the topic that is called map, or the only one that is neither a costmap
            nor predicted occupancy; "": the bag's maps are left out.

    Returns:
        The scene, named after the file. The last message of the map's topic counts; without one the ground
        is free.

    Raises:
        SourceError: the file is no bag, no topic or several topics carry people, several carry a map, people
            and map are in different frames, or the messages make no scene.
    """
    problem = partial(SourceError, path, None)
    with translate_errors(partial(problem, remedy=_REMEDY)), _opened(path) as bag:
        connections = bag.connections
        sources = _people_topic(path, connections, topic)
        maps = _map_topic(path, connections, map_topic)
        last, frames, rows, numbers = None, set(), [], TrackNumbers()
        for connection, received_ns, raw in bag.messages(connections=[*sources, *maps]):
            if connection.msgtype == _GRID:
                last = raw
                continue
            message = bag.deserialize(raw, connection.msgtype)
            frames.add(message.header.frame_id)
            now = seconds(message.header.stamp), received_ns / 1e9
            for name, place in ADAPTERS[connection.msgtype](message):
                rows.append((*now, numbers.number(name), place.x, place.y))
        grid = None if last is None else bag.deserialize(last, _GRID)
        check_frames(frames, grid and grid.header.frame_id, transform)
        stamps, received, tracks, *places = zip(*rows, strict=True) if rows else [()] * 5
        if unstamped := not any(stamps) and any(received):
            _log.warning("%s: all stamps are zero, so times are those at which the bag was written", path)
        time_s = np.array(received if unstamped else stamps, dtype=np.float64)
        track_id = np.array(tracks, dtype=np.int64)
        position = np.array(places, dtype=np.float64).reshape(2, -1).T
        kept, left_out = find_usable(time_s, track_id, position)
        if left_out:
            _log.warning("%s: %s", path, left_out)
        trajectories = Trajectories(time_s[kept], track_id[kept], position[kept])
        trajectories = trajectories if transform is None else transform.moved(trajectories)
        occupancy = OccupancyMap.free_around(trajectories.position) if grid is None else map_of_grid(grid)
        return Scene(path.stem, trajectories, occupancy, trajectories.usual_interval_s())


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """A reader of the bag; bags that do not define their types get `known_types`."""
    if files := _mcap_files(path):
        yield McapReader(files)
        return
    for data_base in path.glob("*.db3") if path.is_dir() else [path]:
        if data_base.suffix == ".db3":
            check_tables(data_base)
    with AnyReader([path], default_typestore=known_types()) as bag:
        for reader in bag.readers:
            bound_unpacking(reader)
        yield bag


def _mcap_files(path: Path) -> list[Path]:
    """The MCAP files of a bag: the file itself, or those that a folder's metadata.yaml lists; else none.

    Raises:
        SourceError: metadata.yaml is damaged, or messages or files are compressed one by one.
    """
    if not path.is_dir():
        return [path] if path.suffix == ".mcap" else []
    about = read_yaml(path / "metadata.yaml", partial(SourceError, path, None, remedy=_MCAP_REMEDY))
    bag = about["rosbag2_bagfile_information"]
    if bag["storage_identifier"] != "mcap":
        return []
    if mode := bag.get("compression_mode"):
        problem = f"its messages or files are compressed one by one ({brief(mode)})"
        raise SourceError(path, None, problem, _MCAP_REMEDY)
    return [path / Path(name).name for name in bag["relative_file_paths"]]


def _people_topic(path: Path, connections: Sequence[Any], topic: str | None) -> list[Any]:
    """The connections that people are taken from: all publishers of one topic."""
    carriers = [c for c in connections if c.msgtype in ADAPTERS and topic in (None, c.topic)]
    if len({(c.topic, c.msgtype) for c in carriers}) == 1:
        return carriers
    found = {c.topic: c.msgtype for c in (carriers or connections)}
    lack = "several topics carry people: choose one (--topic)" if carriers else "no topic carries people"
    raise SourceError(path, None, f"{lack}, among {brief(found)}", _REMEDY)


def _map_topic(path: Path, connections: Sequence[Any], topic: str | None) -> list[Any]:
    """The connections that the map is taken from; none without a map."""
    grids = [c for c in connections if c.msgtype == _GRID]
    names = sorted({c.topic for c in grids})
    if topic is None:
        maps = [name for name in names if name.rpartition("/")[2] == "map"]
        others = [name for name in names if not _NO_MAP.search(name)]
        chosen = maps or others
        if len(chosen) > 1:
            raise SourceError(path, None, f"several topics carry a map: {brief(chosen)}", _MAP_REMEDY)
        if names and not chosen:
            _log.warning(
                "%s: no map, the ground is free: %s are no maps. %s", path, brief(names), _MAP_REMEDY
            )
    else:
        chosen = [topic] if topic else []
        if set(chosen) - set(names):
            raise SourceError(path, None, f"{topic} carries no map, among {brief(names)}", _MAP_REMEDY)
    return [c for c in grids if c.topic in chosen]
