"""The messages in a file of a bag: MCAP, SQLite (.db3) or a bag of ROS 1, each read by its library."""

from __future__ import annotations

import mmap
import sqlite3
from collections.abc import Callable, Generator, Iterator
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
from pedpred.ros.decoding import ROS1, Connection, Decoder
from pedpred.ros.unpacking import LARGEST_BYTES, unpack

Choice = Callable[[Connection], bool]
"""Whether the messages of a connection are needed; called when a connection is found."""
Messages = Generator[tuple[Connection, int, bytes], None, bool]
"""Connection, time of arrival in ns, and bytes, in the order of the file; at last whether it is truncated."""

_LARGEST_RECORD_BYTES = 2**30


def read_messages(path: Path, decoder: Decoder, choose: Choice) -> Messages:
    """Read the chosen messages of a file; its first bytes determine the format.

    Of a truncated MCAP file, the messages of all its whole chunks are read.

    Args:
        path: of the file.
        decoder: stores the definitions of messages that the file contains.
        choose: see `Choice`.

    Raises:
        ContentError: the file is of no such format, or damaged.
    """
    with path.open("rb") as file:
        begin = file.read(16)
    for magic, (read, repair) in _READERS.items():
        if begin.startswith(magic):
            with translate_errors(partial(ContentError, remedy=f"Try to repair it: {repair}")):
                return (yield from read(path, decoder, choose))
    remedy = "A bag is .mcap, .db3 or .bag (version 2.0; `rosbag fix` converts earlier ones)"
    raise ContentError(f"no bag, it begins with {begin!r}", remedy)


class _WholeReads:
    """A file whose end is an error where more is asked for than is left."""

    def __init__(self, raw: mmap.mmap):
        self._raw, self.is_truncated = raw, False

    def read(self, count: int) -> bytes:
        data = self._raw.read(count)
        if len(data) < count:
            self.is_truncated = True
            raise EndOfFile
        return data


def _read_mcap(path: Path, decoder: Decoder, choose: Choice) -> Messages:
    schemas, channels = {0: Schema(0, b"", "", "")}, dict[int, Connection]()
    with path.open("rb") as opened, mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ) as raw:
        file = _WholeReads(raw)
        try:
            for record in _mcap_records(file):
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    schema = schemas[record.schema_id]
                    connection = Connection.of(record.topic, schema.name, record.message_encoding)
                    if connection.can_be_decoded:
                        decoder.define(connection.msgtype, schema.encoding, schema.data.decode())
                    if choose(connection):
                        channels[record.id] = connection
                elif isinstance(record, Message) and record.channel_id in channels:
                    yield channels[record.channel_id], record.log_time, record.data
        except EndOfFile:
            if not file.is_truncated:  # a chunk is damaged
                raise
        return file.is_truncated


def _mcap_records(file: _WholeReads) -> Iterator[McapRecord]:
    """The records of an MCAP file, also those in chunks."""
    limits = {"validate_crcs": True, "record_size_limit": _LARGEST_RECORD_BYTES}
    for record in StreamReader(file, emit_chunks=True, **limits).records:  # type: ignore[arg-type]
        if isinstance(record, Chunk):
            plain = replace(record, compression="", data=unpack(record.data, record.compression))
            yield from breakup_chunk(plain, validate_crc=True)
        else:
            yield record


def _read_sqlite(path: Path, decoder: Decoder, choose: Choice) -> Messages:
    has_log = path.with_name(f"{path.name}-wal").exists()
    address = f"{path.absolute().as_uri()}?{'mode=ro' if has_log else 'immutable=1'}"
    with closing(sqlite3.connect(address, uri=True)) as base:
        limit_values(base, LARGEST_BYTES)
        if "message_definitions" in _tables(base):  # since ROS 2 Iron
            columns = "topic_type, encoding, encoded_message_definition"
            for row in base.execute(f"SELECT {columns} FROM message_definitions"):  # noqa: S608
                decoder.define(*map(str, row))
        rows = base.execute("SELECT id, name, type, serialization_format FROM topics")
        known = {int(number): Connection.of(*map(str, row)) for number, *row in rows}
        chosen = {number: connection for number, connection in known.items() if choose(connection)}
        numbers = ", ".join(map(str, chosen))
        query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({numbers})"  # noqa: S608
        for number, time_ns, raw in base.execute(f"{query} ORDER BY rowid"):
            yield chosen[number], int(time_ns), bytes(raw)
    return False


def _tables(base: sqlite3.Connection) -> set[str]:
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
    with rosbag1.Reader(path) as bag:
        known = {one.id: Connection(one.topic, one.msgtype, ROS1) for one in bag.connections}
        for one in bag.connections:
            decoder.define(one.msgtype, "ros1msg", one.msgdef.data)
        chosen = [one for one in bag.connections if choose(known[one.id])]
        for one, time_ns, raw in bag.messages(chosen) if chosen else ():
            yield known[one.id], time_ns, raw
    return False


_READERS: dict[bytes, tuple[Callable[[Path, Decoder, Choice], Messages], str]] = {
    MCAP0_MAGIC: (_read_mcap, "mcap recover FILE -o repaired.mcap"),
    b"SQLite format 3\0": (_read_sqlite, "sqlite3 FILE .recover | sqlite3 repaired.db3"),
    b"#ROSBAG V2.0\n": (_read_ros1, "rosbag reindex FILE"),
}
"""First bytes -> reader, and the command that repairs a damaged file."""
