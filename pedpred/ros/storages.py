"""The messages in a file of a bag: MCAP, SQLite (.db3) or a bag of ROS 1, each read by its library."""

from __future__ import annotations

import mmap
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path

from mcap.exceptions import EndOfFile
from mcap.records import Channel, Chunk, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from rosbags import rosbag1

from pedpred.errors import ValueRuleError, brief
from pedpred.files import limit_values, translate_errors
from pedpred.reading.errors import ContentError
from pedpred.ros.decoding import CDR, ROS1, Connection, Decoder
from pedpred.ros.unpacking import LARGEST_CHUNK_BYTES, unpack

Choice = Callable[[Connection], bool]
"""Whether the messages of a connection are wanted; called when a connection is found."""
Messages = Iterator[tuple[Connection, int, bytes]]
"""Connection, time of arrival in ns, and bytes, in the order of the file."""

_LARGEST_RECORD_BYTES = 2**30


def read_messages(path: Path, decoder: Decoder, choose: Choice) -> Messages:
    """Read the wanted messages of a file; its first bytes determine the format.

    Args:
        path: of the file.
        decoder: notes the definitions of messages that the file brings.
        choose: see `Choice`.

    Raises:
        EOFError: an MCAP file is cut; the messages of all its whole chunks have been read.
        ContentError: the file is of no such format, or damaged.
        Exception: it is damaged; see `pedpred.files.translate_errors`.
    """
    with path.open("rb") as file:
        begin = file.read(16)
    read = next((reader for magic, reader in _READERS.items() if begin.startswith(magic)), None)
    if read is None:
        remedy = "A bag is .mcap, .db3 or .bag (version 2.0; `rosbag fix` converts earlier ones)"
        raise ContentError(f"no bag, it begins with {begin!r}", remedy)
    yield from read(path, decoder, choose)


def _read_mcap(path: Path, decoder: Decoder, choose: Choice) -> Messages:
    schemas, channels = {0: Schema(0, b"", "", "")}, dict[int, Connection]()
    for record in _mcap_records(path):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            schema, encoding = schemas[record.schema_id], record.message_encoding
            connection = Connection.of(record.topic, schema.name, encoding)
            if encoding in (CDR, ROS1):
                decoder.define(connection.msgtype, schema.encoding, schema.data.decode())
            if choose(connection):
                channels[record.id] = connection
        elif isinstance(record, Message) and record.channel_id in channels:
            yield channels[record.channel_id], record.log_time, record.data


class _WholeReads:
    """A file that ends where less is left than is asked for."""

    def __init__(self, raw: mmap.mmap):
        self._raw = raw

    def read(self, count: int) -> bytes:
        data = self._raw.read(count)
        if len(data) < count:
            raise EndOfFile
        return data


def _mcap_records(path: Path) -> Iterator[McapRecord]:
    """The records of an MCAP file, those in chunks too."""
    remedy = "Try to repair it: mcap recover FILE -o repaired.mcap"
    limits = {"validate_crcs": True, "record_size_limit": _LARGEST_RECORD_BYTES}
    is_cut = False
    with (
        translate_errors(partial(ContentError, remedy=remedy)),
        path.open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as raw,
    ):
        try:
            for record in StreamReader(_WholeReads(raw), emit_chunks=True, **limits).records:  # type: ignore[arg-type]
                yield from _records_of(record) if isinstance(record, Chunk) else (record,)
        except EndOfFile:
            if raw.tell() < len(raw):  # damaged within a chunk
                raise
            is_cut = True
    if is_cut:
        raise EOFError(f"{path} is cut")


def _records_of(chunk: Chunk) -> list[McapRecord]:
    plain = unpack(chunk.data, chunk.compression)
    chunk = replace(chunk, compression="", data=plain)
    return breakup_chunk(chunk, validate_crc=True)


def _read_sqlite(path: Path, decoder: Decoder, choose: Choice) -> Messages:
    has_log = path.with_name(f"{path.name}-wal").exists()
    address = f"{path.absolute().as_uri()}?{'mode=ro' if has_log else 'immutable=1'}"
    remedy = "Try to repair it: sqlite3 FILE .recover | sqlite3 repaired.db3"
    with (
        translate_errors(partial(ContentError, remedy=remedy)),
        closing(sqlite3.connect(address, uri=True)) as base,
    ):
        limit_values(base, LARGEST_CHUNK_BYTES)
        tables = _check_tables(base)
        if "message_definitions" in tables:  # since ROS 2 Iron
            columns = "topic_type, encoding, encoded_message_definition"
            for kind, encoding, text in base.execute(f"SELECT {columns} FROM message_definitions"):  # noqa: S608
                decoder.define(str(kind), str(encoding), str(text))
        rows = base.execute("SELECT id, name, type, serialization_format FROM topics")
        known = {row[0]: Connection.of(*map(str, row[1:])) for row in rows}
        wanted = {number: connection for number, connection in known.items() if choose(connection)}
        listed = ",".join(str(int(number)) for number in wanted)
        query = "SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN"
        for number, time_ns, raw in base.execute(f"{query} ({listed}) ORDER BY rowid"):
            yield wanted[number], int(time_ns), bytes(raw)


def _check_tables(base: sqlite3.Connection) -> set[str]:
    """Names of the tables; views and computed columns, which could go on without end, are refused."""
    entries = "sqlite_master AS entry LEFT JOIN pragma_table_xinfo(entry.name) AS part"
    query = f"SELECT entry.name FROM {entries} WHERE entry.rootpage = 0 OR part.hidden > 1"  # noqa: S608
    if (computed := base.execute(query).fetchone()) is not None:
        raise ValueRuleError("table", computed[0], "a bag has plain tables, nothing that is computed")
    tables = {str(name) for (name,) in base.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if "topics" not in tables:
        rule = "a bag has a table topics. If it is a simulation of JuPedSim, its name must end in .sqlite"
        raise ValueRuleError("tables", brief(sorted(tables)), rule)
    return tables


def _read_ros1(path: Path, decoder: Decoder, choose: Choice) -> Messages:
    remedy = "If its recorder was killed, or the file is cut: rosbag reindex FILE"
    with translate_errors(partial(ContentError, remedy=remedy)), rosbag1.Reader(path) as bag:
        bag.chunks = {at: _bounded(chunk) for at, chunk in bag.chunks.items()}
        known: dict[int, Connection] = {}
        for one in bag.connections:
            connection = Connection(one.topic, one.msgtype, ROS1)
            decoder.define(connection.msgtype, "ros1msg", one.msgdef.data)
            if choose(connection):
                known[one.id] = connection
        chosen = [one for one in bag.connections if one.id in known]
        for one, time_ns, raw in bag.messages(chosen) if chosen else ():
            yield known[one.id], time_ns, raw


def _bounded(chunk: rosbag1.reader.Chunk) -> rosbag1.reader.Chunk:
    """A chunk that is decompressed with the limit of `unpack`."""
    name = next(name for name, call in rosbag1.reader.decompressors.items() if call is chunk.decompressor)
    return chunk._replace(decompressor=partial(unpack, compression="" if name == "none" else name))


_READERS: dict[bytes, Callable[[Path, Decoder, Choice], Messages]] = {
    MCAP0_MAGIC: _read_mcap,
    b"SQLite format 3\0": _read_sqlite,
    b"#ROSBAG V2.0\n": _read_ros1,
}
