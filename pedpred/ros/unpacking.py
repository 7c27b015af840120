"""Unpacking within a bound: a few bytes may unpack to, or compute, more than the memory holds."""

from __future__ import annotations

import sqlite3
from bz2 import BZ2Decompressor
from collections.abc import Callable, Iterator
from contextlib import closing
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

from lz4.frame import LZ4FrameDecompressor
from rosbags import rosbag1
from rosbags.rosbag1.reader import decompressors
from zstandard import ZstdDecompressor

from pedpred.errors import ShapeError, ValueRuleError

LARGEST_CHUNK_BYTES = 2**27
"""Limit of a chunk's uncompressed size; usual writers make chunks of some MiB, and the largest map has 64."""

_UNPACK: dict[str, Callable[[bytes, int], bytes]] = {
    "lz4": lambda raw, most: LZ4FrameDecompressor().decompress(raw, max_length=most),
    "bz2": lambda raw, most: BZ2Decompressor().decompress(raw, max_length=most),
    "zstd": lambda raw, most: ZstdDecompressor().stream_reader(BytesIO(raw)).read(most),
}


def check_unpacked(*sizes: int) -> None:
    """Check sizes of a chunk, bytes, that it has or claims.

    Raises:
        ShapeError: one is larger than `LARGEST_CHUNK_BYTES`.
    """
    if max(sizes) > LARGEST_CHUNK_BYTES:
        raise ShapeError("chunk", sizes, f"at most {LARGEST_CHUNK_BYTES} bytes")


def unpack(raw: bytes, compression: str) -> bytes:
    """Unpack what may not declare its size.

    Args:
        raw: compressed bytes.
        compression: lz4, bz2 or zstd.

    Raises:
        ShapeError: it is larger than `LARGEST_CHUNK_BYTES`.
        Exception: it is damaged; see `pedpred.files.translate_errors`.
    """
    plain = _UNPACK[compression](raw, LARGEST_CHUNK_BYTES + 1)
    check_unpacked(len(plain))
    return plain


def check_tables(path: Path) -> None:
    """Check that a data base holds what it says; views and computed columns could go on without end.

    Raises:
        ValueRuleError: something in it would be computed.
        Exception: it is damaged; see `pedpred.files.translate_errors`.
    """
    entries = "sqlite_master AS entry LEFT JOIN pragma_table_xinfo(entry.name) AS part"
    found = f"SELECT entry.name FROM {entries} WHERE entry.rootpage = 0 OR part.hidden > 1"  # noqa: S608
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1", uri=True)) as base:
        if (computed := base.execute(found).fetchone()) is not None:
            raise ValueRuleError("table", computed[0], "a bag has plain tables, nothing that is computed")


def bound_unpacking(reader: Any) -> None:
    """Let an open reader of rosbags unpack within the bound; by itself it takes whatever a bag asks for."""
    if isinstance(reader, rosbag1.Reader):
        ours = {decompressors[name]: partial(unpack, compression=name) for name in ("lz4", "bz2")}
        for place, chunk in reader.chunks.items():
            reader.chunks[place] = chunk._replace(
                decompressor=ours.get(chunk.decompressor, chunk.decompressor)
            )
    elif reader.compression_mode == "message":
        reader.storage.metadata = reader.storage.metadata._replace(compression_mode=None)
        for storage in reader.storage.storages:
            storage.messages = partial(_unpacked, storage.messages)


def _unpacked(messages: Callable[..., Iterator[Any]], *which: Any) -> Iterator[tuple[Any, int, bytes]]:
    for connection, time_ns, raw in messages(*which):
        yield connection, time_ns, unpack(raw, "zstd")
