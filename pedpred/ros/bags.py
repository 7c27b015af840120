"""Bags of ROS 1 (.bag) and ROS 2 (a folder with metadata.yaml, a single .mcap or .db3), without ROS."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.errors import SourceError
from pedpred.files import translate_errors
from pedpred.ros.reader import occupancy_of
from pedpred.ros.tracked_people import ADAPTERS, Names, seconds
from pedpred.scenes import OccupancyMap, Scene, Trajectories

_GRID = "nav_msgs/msg/OccupancyGrid"
_REMEDY = f"Of people, a bag may hold {', '.join(sorted(ADAPTERS))}; of the map, {_GRID}"


def is_bag(path: Path) -> bool:
    """Whether the name says so; an .mcap file may be a bag or a recording of ours."""
    return path.suffix in (".bag", ".db3") or (path / "metadata.yaml").exists()


def read_bag(path: Path, topic: str | None = None) -> Scene:
    """The people and the map of a bag. Times are the messages' stamps.

    Args:
        path: a .bag, .db3 or .mcap file, or the folder of a ROS 2 bag.
        topic: of the people; may be left out where one topic alone carries any.

    Returns:
        The scene, named after the file. The last map counts; without one the ground is free.

    Raises:
        SourceError: it is no bag, rosbags is not installed, no or several topics carry people, people and map
            are in different frames, or the messages make no scene.
    """
    problem = partial(SourceError, path, None)
    with translate_errors(partial(problem, remedy=_REMEDY)), _opened(path) as bag:
        source = _people_topic(path, bag.connections, topic)
        maps = [connection for connection in bag.connections if connection.msgtype == _GRID]
        grid, frames, rows, names = None, set(), [], Names()
        for connection, _, raw in bag.messages(connections=[source, *maps]):
            message = bag.deserialize(raw, connection.msgtype)
            frames.add(message.header.frame_id.lstrip("/"))
            if connection.msgtype == _GRID:
                grid = message
                continue
            time_s = seconds(message.header.stamp)
            for name, position in ADAPTERS[connection.msgtype](message):
                rows.append((time_s, names.number(name), position.x, position.y))
        if len(frames) > 1:
            raise problem(
                f"people and map are in several frames, {sorted(frames)}", "Record them in one frame"
            )
        table = np.array(rows, dtype=np.float64).reshape(-1, 4)
        trajectories = Trajectories(table[:, 0], table[:, 1], table[:, 2:])
        free = OccupancyMap.free_around(trajectories.position)
        occupancy = free if grid is None else occupancy_of(grid, None)
        return Scene(path.stem, trajectories, occupancy, trajectories.usual_interval_s())


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """A reader that knows the standard messages, for bags that do not describe theirs.

    MCAP files are read by our own, because rosbags takes whatever memory a damaged one asks for.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as cause:
        remedy = "Install it: pip install 'pedpred[ros]'"
        raise SourceError(path, None, "bags are read by the package rosbags", remedy) from cause
    from pedpred.ros.mcap_bag import McapBag, mcap_files  # imports rosbags, which need not be there

    if files := mcap_files(path):
        yield McapBag(files)
        return
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
        yield bag


def _people_topic(path: Path, connections: Sequence[Any], topic: str | None) -> Any:
    """The connection that people are taken from."""
    carriers = [c for c in connections if c.msgtype in ADAPTERS and topic in (None, c.topic)]
    if len(carriers) == 1:
        return carriers[0]
    found = {c.topic: c.msgtype for c in (carriers or connections)}
    lack = "several topics carry people: choose one" if carriers else "no topic carries people"
    raise SourceError(path, None, f"{lack}, among {found}", _REMEDY)
