"""The files of a bag: those of a folder, with or without metadata.yaml; compressed ones are unpacked."""

from __future__ import annotations

import logging
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import BinaryIO, NamedTuple

from zstandard import ZstdDecompressor

from pedpred.errors import InputError, ShapeError, brief
from pedpred.files import read_yaml

METADATA = "metadata.yaml"
_STORED = re.compile(r"\.(mcap|db3)(\.zstd|\.zst)?$")
_SINGLE = re.compile(r"\.(db3|bag|bag\.active|active)(\.zstd|\.zst)?$|\.mcap(\.zstd|\.zst)$")
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_LARGEST_BYTES, _LARGEST_RATIO, _BLOCK_BYTES, _ZEROS_BYTES = 2**30, 100, 2**22, 2**16
"""Limits of an unpacked file: bytes, or a multiple of its packed size, whichever is larger."""

_log = logging.getLogger(__name__)


class BagFile(NamedTuple):
    """A file of a bag.

    Attributes:
        name: what the user calls it.
        content: where its bytes are; differs from `name` where they had to be unpacked.
    """

    name: Path
    content: Path

    def begins(self) -> bytes:
        """Its first bytes."""
        with self.content.open("rb") as file:
            return file.read(16)


def is_bag(path: Path) -> bool:
    """Whether the name is that of a bag; an .mcap file may be a bag or a recording of `write_recording`."""
    if path.is_dir():
        return (path / METADATA).exists() or (not (path / "scene.json").exists() and bool(_stored_in(path)))
    return bool(_SINGLE.search(path.name))


def written_bytes(file: BinaryIO) -> int:
    """Size of a file without zeros at its end, which a disk may leave when the power fails.

    Args:
        file: open; where it is read next does not change.
    """
    here, end = file.tell(), file.seek(0, os.SEEK_END)
    while end:
        begin = max(end - _ZEROS_BYTES, 0)
        file.seek(begin)
        end = begin + len(file.read(end - begin).rstrip(b"\0"))
        if end > begin:
            break
    file.seek(here)
    return end


@contextmanager
def unpacked_files(path: Path) -> Iterator[list[BagFile]]:
    """The files of a bag in order, those that are compressed as a whole (zstd) unpacked until the block ends.

    Args:
        path: of a file, or of a folder; without a readable metadata.yaml the names give the order.

    Raises:
        InputError: the folder holds no files of a bag, or not those that metadata.yaml names.
        ShapeError: a file would unpack to more than `_LARGEST_BYTES` and `_LARGEST_RATIO`.
    """
    names = _files_of(path) if path.is_dir() else [path]
    with tempfile.TemporaryDirectory(prefix="pedpred-bag-") as scratch:
        files = [BagFile(name, name) for name in names if name.stat().st_size or len(names) == 1]
        if len(files) < len(names):
            _log.warning("%s: %d files are empty", path, len(names) - len(files))
        for number, file in enumerate(files):
            if file.begins().startswith(_ZSTD_MAGIC):
                files[number] = BagFile(file.name, Path(scratch) / str(number))
                with file.name.open("rb") as packed, files[number].content.open("wb") as plain:
                    _unpack(packed, plain, max(_LARGEST_BYTES, _LARGEST_RATIO * file.name.stat().st_size))
        yield files


def _unpack(packed: BinaryIO, plain: BinaryIO, most: int) -> None:
    """Unpack as much as is whole of a file."""
    size = 0
    with ZstdDecompressor().stream_reader(packed, read_across_frames=True) as stream:
        while block := stream.read(_BLOCK_BYTES):
            size += len(block)
            if size > most:
                raise ShapeError("file", (size,), f"at most {most} bytes when unpacked")
            plain.write(block)


def _files_of(folder: Path) -> list[Path]:
    """Files of a folder: those that metadata.yaml names, or all where a killed recorder wrote none."""
    about = folder / METADATA
    if not about.exists() or not about.stat().st_size:
        stored = _stored_in(folder)
        if not stored:
            raise InputError(folder, None, "it holds no .mcap and no .db3 file", "Name the folder of a bag")
        _log.warning(
            "%s: no %s, so all are read: %s", folder, METADATA, brief([each.name for each in stored])
        )
        return stored
    wording = partial(InputError, about, None, remedy=f"Remove it: without {METADATA} all files are read")
    bag = read_yaml(about, wording).get("rosbag2_bagfile_information")
    named = bag.get("relative_file_paths") if isinstance(bag, dict) else None
    if not isinstance(named, list) or not named or not all(isinstance(name, str) for name in named):
        raise wording("no relative_file_paths in rosbag2_bagfile_information")
    files = [_as_stored(folder / Path(name).name) for name in named]
    if missing := [file.name for file in files if not file.is_file()]:
        raise wording(f"it names files that are missing: {brief(missing)}")
    return files


def _as_stored(file: Path) -> Path:
    """A file under the name that it has: before or after it was compressed, if the other one is missing."""
    other = file.with_suffix("") if file.suffix == ".zstd" else file.with_name(f"{file.name}.zstd")
    return other if other.is_file() and not file.is_file() else file


def _stored_in(folder: Path) -> list[Path]:
    """Files of a bag in a folder, bag_2 before bag_10; of a file that is there twice the unpacked one."""
    files = {file.name: file for file in folder.iterdir() if file.is_file() and _STORED.search(file.name)}
    kept = [
        file for name, file in files.items() if file.suffix in (".mcap", ".db3") or file.stem not in files
    ]
    return sorted(
        kept,
        key=lambda file: [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", file.name)],
    )
