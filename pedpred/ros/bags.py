"""Bags of ROS 1 (.bag) and ROS 2 (a folder with metadata.yaml, a single .mcap or .db3), without ROS."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader

from pedpred.errors import SourceError
from pedpred.files import read_yaml, translate_errors
from pedpred.ros.mcap_reader import McapReader
from pedpred.ros.message_types import MAP, TYPES, known_types
from pedpred.ros.scene_messages import map_of_grid, seconds
from pedpred.scenes import OccupancyMap, Scene, Trajectories

Adapter = Callable[[Any], Iterator[tuple[object, Any]]]
"""A message -> (name, position with x and y in m) of every person in it."""


def _poses(message: Any) -> Iterator[tuple[object, Any]]:
    """Poses have no names: the index in the list identifies the person."""
    return ((index, pose.position) for index, pose in enumerate(message.poses))


ADAPTERS: dict[str, Adapter] = {
    "people_msgs/msg/People": lambda m: ((p.name, p.position) for p in m.people),
    "spencer_tracking_msgs/msg/TrackedPersons": lambda m: (
        (t.track_id, t.pose.pose.position) for t in m.tracks
    ),
    "hunav_msgs/msg/Agents": lambda m: ((a.id, a.position.position) for a in m.agents),
    "vision_msgs/msg/Detection3DArray": lambda m: ((d.id, d.bbox.center.position) for d in m.detections),
    "geometry_msgs/msg/PoseArray": _poses,
}
"""The supported message types. All have a header with stamp and frame."""

_GRID = TYPES[MAP]
_REMEDY = f"A bag may hold {', '.join(sorted(ADAPTERS))} for people and {_GRID} for the map"
_MCAP_REMEDY = "Record it with `ros2 bag record`, or repair it with the `mcap` command line tool"


def is_bag(path: Path) -> bool:
    """Whether the name is that of a bag; an .mcap file may be a bag or a recording of `write_recording`."""
    return path.suffix in (".bag", ".db3") or (path / "metadata.yaml").exists()


def read_bag(path: Path, topic: str | None = None) -> Scene:
    """Read the people and the map of a bag. Times are the messages' stamps.

    Args:
        path: a .bag, .db3 or .mcap file, or the folder of a ROS 2 bag.
        topic: of the people; optional where only one topic carries people.

    Returns:
        The scene, named after the file. The last map counts; without one the ground is free.

    Raises:
        SourceError: the file is no bag, no topic or several topics carry people, people and map are in
            different frames, or the messages make no scene.
    """
    problem = partial(SourceError, path, None)
    with translate_errors(partial(problem, remedy=_REMEDY)), _opened(path) as bag:
        connections = bag.connections
        source = _people_topic(path, connections, topic)
        maps = [connection for connection in connections if connection.msgtype == _GRID]
        grid, frames, rows, numbers = None, set(), [], TrackNumbers()
        for connection, _, raw in bag.messages(connections=[source, *maps]):
            message = bag.deserialize(raw, connection.msgtype)
            frames.add(message.header.frame_id.lstrip("/"))
            if connection.msgtype == _GRID:
                grid = message
                continue
            time_s = seconds(message.header.stamp)
            for name, position in ADAPTERS[connection.msgtype](message):
                rows.append((time_s, numbers.number(name), position.x, position.y))
        if len(frames) > 1:
            raise problem(
                f"people and map are in several frames, {sorted(frames)}", "Record them in one frame"
            )
        table = np.array(rows, dtype=np.float64).reshape(-1, 4)
        trajectories = Trajectories(table[:, 0], table[:, 1], table[:, 2:])
        free = OccupancyMap.free_around(trajectories.position)
        occupancy = free if grid is None else map_of_grid(grid)
        return Scene(path.stem, trajectories, occupancy, trajectories.usual_interval_s())


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """A reader of the bag; bags that do not define their types get `known_types`."""
    if files := _mcap_files(path):
        yield McapReader(files)
        return
    with AnyReader([path], default_typestore=known_types()) as bag:
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
        problem = f"its messages or files are compressed one by one ({mode})"
        raise SourceError(path, None, problem, _MCAP_REMEDY)
    return [path / Path(name).name for name in bag["relative_file_paths"]]


def _people_topic(path: Path, connections: Sequence[Any], topic: str | None) -> Any:
    """The connection that people are taken from."""
    carriers = [c for c in connections if c.msgtype in ADAPTERS and topic in (None, c.topic)]
    if len(carriers) == 1:
        return carriers[0]
    found = {c.topic: c.msgtype for c in (carriers or connections)}
    lack = "several topics carry people: choose one" if carriers else "no topic carries people"
    raise SourceError(path, None, f"{lack}, among {found}", _REMEDY)


class TrackNumbers:
    """Track numbers for names: a decimal number keeps its value, other names get -1, -2, ... in order."""

    def __init__(self) -> None:
        self._given: dict[str, int] = {}

    def number(self, name: object) -> int:
        """The number of a name, the same on every call."""
        text = str(name)
        if text.isascii() and text.isdecimal():
            return int(text)
        return self._given.setdefault(text, -1 - len(self._given))
