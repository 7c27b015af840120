"""MCAP files read record by record within bounds, also damaged files and files that are cut.

The file is mapped, not read, and no record and no chunk takes more memory than a bound, whatever it declares.
"""

from __future__ import annotations

import mmap
import struct
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mcap.exceptions import EndOfFile
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from zstandard import frame_content_size

from pedpred.errors import SourceError
from pedpred.ros.message_types import known_types
from pedpred.ros.unpacking import check_unpacked, unpack

_RECORD_HEAD = struct.Struct("<BQ")
"""Kind of a record and the length of its content."""
_LARGEST_RECORD_BYTES = 2**30
_IDL_PART = "=" * 80 + "\n"
_REMEDY = "Give the name of an MCAP file"


@dataclass(frozen=True)
class Connection:
    """A topic and the type of its messages."""

    topic: str
    msgtype: str


class McapReader:
    """MCAP files of one bag, with the interface of rosbags' own readers.

    rosbags itself decodes the messages, but reads the files with whatever memory a damaged one asks for.

    Attributes:
        metadata: the metadata records that `messages` has passed so far, by name.
    """

    def __init__(self, files: Sequence[Path]):
        self.metadata: dict[str, dict[str, str]] = {}
        self._files = files
        self._schemas: dict[str, Schema] = {}
        self._types = get_typestore(Stores.EMPTY)

    @property
    def connections(self) -> list[Connection]:
        """Every topic with CDR messages, once; reads the files."""
        return list(dict.fromkeys(connection for file in self._files for connection, *_ in self._walk(file)))

    def messages(self, connections: Sequence[Connection] = ()) -> Iterator[tuple[Connection, int, bytes]]:
        """Topic, time (ns) and bytes of the messages of some connections (default: all), in file order."""
        for file in self._files:
            for connection, time_ns, raw in self._walk(file):
                if raw is not None and (connection in connections or not connections):
                    yield connection, time_ns, raw

    def deserialize(self, raw: bytes, msgtype: str) -> Any:
        """Decode a message by the definition in the file, or by `known_types` where it has none."""
        if msgtype not in self._types.fielddefs:
            self._register(self._schemas[msgtype])
        return self._types.deserialize_cdr(raw, msgtype)

    def _walk(self, file: Path) -> Iterator[tuple[Connection, int, bytes | None]]:
        """Every channel (without bytes) and every message of a file, if they are CDR."""
        schemas: dict[int, Schema] = {}
        channels: dict[int, Connection] = {}
        for record in records(file):
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Metadata):
                self.metadata[record.name] = record.metadata
            elif isinstance(record, Channel) and record.message_encoding == "cdr":
                schema = schemas[record.schema_id]
                self._schemas.setdefault(schema.name, schema)
                channels[record.id] = Connection(record.topic, schema.name)
                yield channels[record.id], 0, None
            elif isinstance(record, Message) and record.channel_id in channels:
                yield channels[record.channel_id], record.log_time, record.data

    def _register(self, schema: Schema) -> None:
        text = schema.data.decode()
        if not text:
            self._types.register(known_types().fielddefs)
        elif schema.encoding == "ros2msg":
            self._types.register(get_types_from_msg(text, schema.name))
        else:
            for part in text.split(_IDL_PART):
                self._types.register(
                    get_types_from_idl(part.partition("\n")[2] if _IDL_PART in text else part)
                )


def records(path: Path) -> Iterator[McapRecord]:
    """Read all records, those in chunks too; of a file that is cut those before the cut, with a warning.

    Raises:
        SourceError: it is no MCAP file.
        Exception: it is damaged; see `pedpred.files.translate_errors`.
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


def _last_whole_record(raw: mmap.mmap) -> int:
    """The end of the last complete record, bytes."""
    end = len(MCAP0_MAGIC)
    while end + _RECORD_HEAD.size <= len(raw):
        _, length = _RECORD_HEAD.unpack_from(raw, end)
        if end + _RECORD_HEAD.size + length > len(raw):
            break
        end += _RECORD_HEAD.size + length
    return end
