"""MCAP files read record by record within bounds, also damaged files and files that are cut.

The file is mapped, not read, and no record and no chunk takes more memory than a bound, whatever it declares.
"""

from __future__ import annotations

import mmap
import struct
import warnings
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from zstandard import frame_content_size

from pedpred.errors import InputError
from pedpred.ros.bag_files import BagFile, written_bytes
from pedpred.ros.bag_reader import RecordReader
from pedpred.ros.decoding import CDR, ROS1, Connection
from pedpred.ros.unpacking import check_unpacked, unpack

_RECORD_HEAD = struct.Struct("<BQ")
"""Kind of a record and the length of its content."""
_CHUNK_HEAD, _DATA_LENGTH_BYTES = struct.Struct("<28xL"), 8
"""What precedes the name of a chunk's compression, and what follows it."""
_LARGEST_RECORD_BYTES, _LARGEST_REST_BYTES = 2**30, 2**28
_REMEDY = "Give the name of an MCAP file"


class McapReader(RecordReader):
    """MCAP files of one bag.

    rosbags itself decodes the messages, but reads the files with whatever memory a damaged one asks for.

    Attributes:
        metadata: the metadata records that `messages` has passed so far, by name.
    """

    def __init__(self, files: Sequence[BagFile]):
        self.metadata: dict[str, dict[str, str]] = {}
        super().__init__(files)

    def _walk(self, file: BagFile) -> Iterator[tuple[Connection, int, bytes | None]]:
        schemas: dict[int, Schema] = {0: Schema(0, b"", "", "")}
        channels: dict[int, Connection] = {}
        for record in records(file):
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Metadata):
                self.metadata[record.name] = record.metadata
            elif isinstance(record, Channel):
                schema, encoding = schemas[record.schema_id], record.message_encoding
                channels[record.id] = Connection.of(record.topic, schema.name, encoding)
                if encoding in (CDR, ROS1):
                    self._decoder.define(channels[record.id].msgtype, schema.encoding, schema.data.decode())
                yield channels[record.id], 0, None
            elif isinstance(record, Message) and record.channel_id in channels:
                yield channels[record.channel_id], record.log_time, record.data


def records(file: BagFile) -> Iterator[McapRecord]:
    """Read all records, those in chunks too; of a file that is cut those before the cut, with a warning.

    Raises:
        InputError: it is no MCAP file.
        Exception: it is damaged; see `pedpred.files.translate_errors`.
    """
    with file.content.open("rb") as stream:
        begin = stream.read(len(MCAP0_MAGIC))
        if begin != MCAP0_MAGIC:
            raise InputError(file.name, None, f"no MCAP file, it begins with {begin!r}", _REMEDY)
        with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as raw:
            size = len(raw)
            cut = size == len(MCAP0_MAGIC) or raw[-len(MCAP0_MAGIC) :] != MCAP0_MAGIC
            written = max(written_bytes(stream), len(MCAP0_MAGIC)) if cut else size
            end = _last_whole_record(raw, len(MCAP0_MAGIC), written) if cut else size
            rest = raw[end : min(end + _LARGEST_REST_BYTES, written)]
        if cut:
            more = ", and what is whole of the chunk there," if rest[:1] == bytes([Opcode.CHUNK]) else ""
            warnings.warn(f"{file.name} is cut: read up to byte {end}{more} of {size}", stacklevel=2)
        with mmap.mmap(stream.fileno(), end, access=mmap.ACCESS_READ) as raw:
            yield from _unchunked(raw, cut)
        if rest:
            yield from _cut_chunk(rest)


def _unchunked(raw: Any, cut: bool) -> Iterator[McapRecord]:
    """All records of an MCAP file's bytes, which may end where a record ends."""
    reader = StreamReader(raw, emit_chunks=True, validate_crcs=True, record_size_limit=_LARGEST_RECORD_BYTES)
    try:
        for record in reader.records:
            yield from _unpack(record) if isinstance(record, Chunk) else (record,)
    except EndOfFile:
        if not cut:
            raise


def _unpack(chunk: Chunk) -> list[McapRecord]:
    """The records in a chunk, after a check that they fit the bound."""
    content = len(chunk.data)
    if chunk.compression == "zstd":
        content = frame_content_size(chunk.data)
    elif chunk.compression == "lz4":  # its frames need not declare their size
        plain = unpack(chunk.data, "lz4")
        chunk, content = replace(chunk, compression="", data=plain), len(plain)
    check_unpacked(chunk.uncompressed_size, content)
    return breakup_chunk(chunk, validate_crc=True)


def _cut_chunk(raw: bytes) -> list[McapRecord]:
    """The complete records in a chunk that is cut; nothing of other records, nothing that is damaged."""
    with suppress(Exception):  # there are whole records before, and that the file is cut has been said
        begin = _RECORD_HEAD.size + _CHUNK_HEAD.size
        (length,) = _CHUNK_HEAD.unpack_from(raw, _RECORD_HEAD.size)
        compression, data = raw[begin : begin + length].decode(), raw[begin + length + _DATA_LENGTH_BYTES :]
        plain = unpack(data, compression) if compression else data
        if raw[0] == Opcode.CHUNK:
            whole = plain[: _last_whole_record(plain, 0, len(plain))]
            return breakup_chunk(Chunk("", whole, 0, 0, 0, len(whole)))
    return []


def _last_whole_record(raw: mmap.mmap | bytes, begin: int, size: int) -> int:
    """The end of the last complete record between some bytes."""
    end = begin
    while end + _RECORD_HEAD.size <= size:
        _, length = _RECORD_HEAD.unpack_from(raw, end)
        if end + _RECORD_HEAD.size + length > size:
            break
        end += _RECORD_HEAD.size + length
    return end
