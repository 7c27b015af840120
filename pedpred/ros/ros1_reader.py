"""Bags of ROS 1 (.bag, version 2.0) read record by record, also without an index or cut."""

from __future__ import annotations

import os
import struct
import warnings
from collections.abc import Iterator
from io import BytesIO
from typing import BinaryIO

from rosbags.rosbag1.reader import Header, ReaderError, RecordType, normalize

from pedpred.errors import ShapeError
from pedpred.ros.bag_files import BagFile, written_bytes
from pedpred.ros.bag_reader import RecordReader
from pedpred.ros.decoding import ROS1, Connection
from pedpred.ros.unpacking import check_unpacked, unpack

ROS1_MAGIC = b"#ROSBAG V2.0\n"
_LENGTH = struct.Struct("<L")
_LARGEST_HEADER_BYTES = 2**20
_READ = (RecordType.CHUNK, RecordType.CONNECTION, RecordType.MSGDATA)

_Record = tuple[RecordType, Header, bytes]


class Ros1Reader(RecordReader):
    """The bags of one recording."""

    def _walk(self, file: BagFile) -> Iterator[tuple[Connection, int, bytes | None]]:
        known: dict[int, Connection] = {}
        for kind, header, content in _records(file):
            if kind not in (RecordType.MSGDATA, RecordType.CONNECTION):
                continue
            number = header.get_uint32("conn")
            if kind == RecordType.MSGDATA:
                yield known[number], header.get_time("time"), content
                continue
            about = Header.read(BytesIO(_LENGTH.pack(len(content)) + content))
            known[number] = Connection.of(
                normalize(header.get_string("topic")), about.get_string("type"), ROS1
            )
            self._decoder.define(known[number].msgtype, "ros1msg", about.get_string("message_definition"))
            yield known[number], 0, None


def _records(file: BagFile) -> Iterator[_Record]:
    """The records of a bag, those in chunks too; of one that is cut or was not closed those up to there."""
    with file.content.open("rb") as stream:
        size = os.fstat(stream.fileno()).st_size
        stream.seek(len(ROS1_MAGIC))
        first = _next(stream, size)
        closed = first is not None and 0 < first[1].get_uint64("index_pos") <= size
        end = stream.tell()
        written = size if closed else max(written_bytes(stream), end)
        try:
            while record := _next(stream, written):
                yield from _inner(record) if record[0] == RecordType.CHUNK else (record,)
                end = stream.tell()
        except (
            ReaderError,
            ShapeError,
            struct.error,
            ValueError,
            RuntimeError,
            OSError,
        ):  # the last: of chunks
            if closed:
                raise
        if not (closed and end == size):
            warnings.warn(
                f"{file.name} is cut or was not closed: read up to byte {end} of {size}", stacklevel=2
            )


def _inner(chunk: _Record) -> Iterator[_Record]:
    """The records of a chunk, which may be cut."""
    _, header, content = chunk
    compression = header.get_string("compression")
    plain = content if compression == "none" else unpack(content, compression)
    stream, end = BytesIO(plain), 0
    while (record := _next(stream, len(plain))) and record[0] != RecordType.CHUNK:
        end = stream.tell()
        yield record
    if end != len(plain):
        raise ReaderError(f"a chunk is damaged at byte {end} of {len(plain)}")


def _next(stream: BinaryIO, size: int) -> _Record | None:
    """The next record of a stream of some bytes, with the content of those of `_READ`; None: no whole one."""
    start = stream.read(_LENGTH.size)
    if len(start) < _LENGTH.size:
        return None
    (length,) = _LENGTH.unpack(start)
    if length > _LARGEST_HEADER_BYTES:
        raise ShapeError("header of a record", (length,), f"at most {_LARGEST_HEADER_BYTES} bytes")
    if length > size - stream.tell():
        return None
    stream.seek(-_LENGTH.size, os.SEEK_CUR)
    header = Header.read(stream)
    kind, start = RecordType(header.get_uint8("op")), stream.read(_LENGTH.size)
    if len(start) < _LENGTH.size:
        return None
    (length,), rest = _LENGTH.unpack(start), size - stream.tell()
    if kind == RecordType.CHUNK and not length and header.get_string("compression") != "none":
        length = rest  # the recorder writes the length of a chunk when the chunk is full
    if kind in _READ:
        check_unpacked(min(length, rest))
        content = stream.read(min(length, rest))
        return (kind, header, content) if len(content) == length or kind == RecordType.CHUNK else None
    if length > rest:
        return None
    stream.seek(length, os.SEEK_CUR)
    return kind, header, b""
