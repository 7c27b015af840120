"""Unpacking within a bound: a few bytes may unpack to, or compute, more than the memory holds."""

from __future__ import annotations

import sqlite3
from bz2 import BZ2Decompressor
from collections.abc import Callable
from io import BytesIO

from lz4.frame import LZ4FrameDecompressor
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


def check_tables(base: sqlite3.Connection) -> None:
    """Check that a data base holds what it says; views and computed columns could go on without end.

    Raises:
        ValueRuleError: something in it would be computed.
        Exception: it is damaged; see `pedpred.files.translate_errors`.
    """
    entries = "sqlite_master AS entry LEFT JOIN pragma_table_xinfo(entry.name) AS part"
    query = f"SELECT entry.name FROM {entries} WHERE entry.rootpage = 0 OR part.hidden > 1"  # noqa: S608
    if (computed := base.execute(query).fetchone()) is not None:
        raise ValueRuleError("table", computed[0], "a bag has plain tables, nothing that is computed")
