"""The records of an MCAP file, also of one that is damaged or ends in the middle.

The file is mapped, not read, and no record and no chunk takes more memory than a bound, whatever it claims.
"""

from __future__ import annotations

import mmap
import struct
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from lz4.frame import LZ4FrameDecompressor
from mcap.exceptions import EndOfFile
from mcap.records import Chunk, McapRecord
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from zstandard import frame_content_size

from pedpred.errors import ShapeError, SourceError

_RECORD_HEAD = struct.Struct("<BQ")
"""Kind and length of what follows."""
_LARGEST_RECORD_BYTES = 2**30
_LARGEST_CHUNK_BYTES = 2**28
"""Of what a chunk may claim to hold, uncompressed; writers make chunks of some MiB."""
_REMEDY = "Give the name of an MCAP file"


def records(path: Path) -> Iterator[McapRecord]:
    """All records, those in chunks as well; of a file that ends in the middle those before the cut.

    A cut file gives a warning that tells where.

    Raises:
        SourceError: no MCAP file.
        Exception: it is damaged, whatever the decoder makes of it; see `pedpred.files.translate_errors`.
    """
    with path.open("rb") as file:
        begin = file.read(len(MCAP0_MAGIC))
        if begin != MCAP0_MAGIC:
            raise SourceError(path, None, f"no MCAP file, it begins with {begin!r}", _REMEDY)
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as raw:
            size = len(raw)
            cut = size == len(MCAP0_MAGIC) or raw[-len(MCAP0_MAGIC) :] != MCAP0_MAGIC
            end = _last_whole_record(raw) if cut else size
        if cut:
            warnings.warn(f"{path} is cut: read up to byte {end} of {size}", stacklevel=2)
        with mmap.mmap(file.fileno(), end, access=mmap.ACCESS_READ) as raw:
            yield from _unchunked(raw, cut)


def _unchunked(raw: Any, cut: bool) -> Iterator[McapRecord]:
    """All records of an MCAP file's bytes, which may end where a record ends."""
    reader = StreamReader(raw, emit_chunks=True, validate_crcs=True, record_size_limit=_LARGEST_RECORD_BYTES)
    try:
        for record in reader.records:
            yield from _unpacked(record) if isinstance(record, Chunk) else (record,)
    except EndOfFile:
        if not cut:
            raise


def _unpacked(chunk: Chunk) -> list[McapRecord]:
    """The records in a chunk, once it is known that they do not fill the memory."""
    content = len(chunk.data)
    if chunk.compression == "zstd":
        content = frame_content_size(chunk.data)
    elif chunk.compression == "lz4":  # its frames need not say how much they hold
        plain = LZ4FrameDecompressor().decompress(chunk.data, max_length=_LARGEST_CHUNK_BYTES + 1)
        chunk, content = replace(chunk, compression="", data=plain), len(plain)
    if max(chunk.uncompressed_size, content) > _LARGEST_CHUNK_BYTES:
        raise ShapeError("chunk", (chunk.uncompressed_size, content), f"at most {_LARGEST_CHUNK_BYTES} bytes")
    return breakup_chunk(chunk, validate_crc=True)


def _last_whole_record(raw: mmap.mmap) -> int:
    """Where the last record ends that is there in full."""
    end = len(MCAP0_MAGIC)
    while end + _RECORD_HEAD.size <= len(raw):
        _, length = _RECORD_HEAD.unpack_from(raw, end)
        if end + _RECORD_HEAD.size + length > len(raw):
            break
        end += _RECORD_HEAD.size + length
    return end
