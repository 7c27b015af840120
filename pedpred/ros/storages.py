"""Bags of every storage, opened by how their files begin, whatever suffixes and metadata.yaml say."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mcap.writer import MCAP0_MAGIC

from pedpred.errors import InputError, brief
from pedpred.ros.bag_files import unpacked_files
from pedpred.ros.bag_reader import BagReader
from pedpred.ros.mcap_reader import McapReader
from pedpred.ros.ros1_reader import ROS1_MAGIC, Ros1Reader
from pedpred.ros.sqlite_reader import SQLITE_MAGIC, SqliteReader

_REMEDY = "A bag is .mcap, .db3 or .bag (version 2.0; `rosbag fix` makes it of earlier ones)"
_READERS: dict[bytes, type[BagReader]] = {
    MCAP0_MAGIC: McapReader,
    SQLITE_MAGIC: SqliteReader,
    ROS1_MAGIC: Ros1Reader,
}


@contextmanager
def opened(path: Path) -> Iterator[BagReader]:
    """Open a file, or the folder of a bag, until the block ends.

    Raises:
        InputError: it is not a bag, or its files are of several storages.
    """
    with unpacked_files(path) as files:
        kinds = {
            next((magic for magic in _READERS if file.begins().startswith(magic)), b"") for file in files
        }
        if len(kinds) != 1 or not all(kinds):
            begins = brief({file.name.name: file.begins() for file in files})
            raise InputError(path, None, f"no bag, or several, whose files begin with {begins}", _REMEDY)
        yield _READERS[kinds.pop()](files)
