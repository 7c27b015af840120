"""The files of a bag, by their names; files that are compressed as a whole (zstd) are unpacked."""

from __future__ import annotations

import logging
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from zstandard import ZstdDecompressor

from pedpred.errors import InputError, ValueRuleError

_STORED = re.compile(r"\.(mcap|db3)(\.zstd|\.zst)?$")
_SINGLE = re.compile(r"\.(mcap|db3|bag|bag\.active)(\.zstd|\.zst)?$")
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_LARGEST_BYTES, _LARGEST_RATIO, _BLOCK_BYTES = 2**30, 100, 2**22
"""Limits of an unpacked file: bytes, or a multiple of its packed size, whichever is larger."""
_log = logging.getLogger(__name__)


def is_bag(path: Path) -> bool:
    """Whether a file has the name of a bag, or a folder contains files of one and is no scene."""
    if path.is_dir():
        return not (path / "scene.json").exists() and bool(_files_in(path))
    return bool(_SINGLE.search(path.name))


@contextmanager
def open_files(path: Path) -> Iterator[list[tuple[Path, Path]]]:
    """The files of a bag in order, each with where its content is: unpacked until the block ends, or itself.

    Args:
        path: of a file, or of a folder, in which files are in the order of their names and numbers.

    Raises:
        InputError: the folder contains no files of a bag.
        ValueRuleError: a file would unpack to more than `_LARGEST_BYTES` and `_LARGEST_RATIO`.
    """
    files = _files_in(path) if path.is_dir() else [path]
    if not files:
        raise InputError(path, None, "it contains no .mcap and no .db3 file", "Name the folder of a bag")
    with tempfile.TemporaryDirectory(prefix="pedpred-bag-") as scratch:
        stored = []
        for number, file in enumerate(files):
            plain = file
            if _is_packed(file):
                plain = Path(scratch, f"{number}")
                with plain.open("wb") as target:
                    target.writelines(_unpacked_blocks(file))
            stored.append((file, plain))
        yield stored


def _files_in(folder: Path) -> list[Path]:
    """Files of a bag in a folder, bag_2 before bag_10; of a file that is there twice the unpacked one."""
    files = [file for file in folder.iterdir() if file.is_file() and _STORED.search(file.name)]
    names = {file.name for file in files}
    kept = [file for file in files if file.stem not in names and file.stat().st_size]
    if len(kept) < len(files):
        _log.warning("%s: %d files are empty, or there twice", folder, len(files) - len(kept))
    return sorted(kept, key=lambda file: _texts_and_numbers(file.name))


def _texts_and_numbers(name: str) -> list[tuple[str, int]]:
    return [(text, int(number or 0)) for text, number in re.findall(r"(\D+)(\d*)", f"_{name}")]


def _is_packed(file: Path) -> bool:
    with file.open("rb") as begin:
        return begin.read(len(_ZSTD_MAGIC)) == _ZSTD_MAGIC


def _unpacked_blocks(file: Path) -> Iterator[bytes]:
    """The content of a compressed file, within the limits."""
    most, size = max(_LARGEST_BYTES, _LARGEST_RATIO * file.stat().st_size), 0
    with (
        file.open("rb") as packed,
        ZstdDecompressor().stream_reader(packed, read_across_frames=True) as stream,
    ):
        while block := stream.read(_BLOCK_BYTES):
            size += len(block)
            if size > most:
                raise ValueRuleError("size", size, f"it may be {most} bytes when unpacked")
            yield block
