"""Data bases of ROS 2 (.db3) read row by row within bounds, also damaged files and files that are cut."""

from __future__ import annotations

import shutil
import sqlite3
import struct
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from pedpred.errors import InputError, brief
from pedpred.files import limit_values
from pedpred.ros.bag_files import BagFile, written_bytes
from pedpred.ros.bag_reader import BagReader
from pedpred.ros.decoding import Connection
from pedpred.ros.unpacking import LARGEST_CHUNK_BYTES, check_tables

SQLITE_MAGIC = b"SQLite format 3\0"
_LARGEST_DEFINITION, _FEW_ZEROS = 2**20, 64
_HEADER_BYTES, _PAGE_AT, _PAGE_BYTES = 100, 16, struct.Struct(">H")


class SqliteReader(BagReader):
    """The data bases of one bag."""

    def _connections(self, file: BagFile) -> Iterator[Connection]:
        with _opened(file) as base:
            self._define(base)
            yield from _topics(base).values()

    def _messages(
        self, file: BagFile, connections: Sequence[Connection]
    ) -> Iterator[tuple[Connection, int, bytes]]:
        with _opened(file) as base:
            _warn_of_zeros(base, file)
            yield from _rows(base, file, connections)

    def _define(self, base: sqlite3.Connection) -> None:
        """Note the definitions in a data base; earlier versions have none, and a cut may have taken them."""
        columns = "topic_type, encoding, encoded_message_definition"
        with suppress(sqlite3.DatabaseError):
            for kind, encoding, text in base.execute(f"SELECT {columns} FROM message_definitions"):  # noqa: S608
                self._decoder.define(str(kind), str(encoding), str(text)[:_LARGEST_DEFINITION])


def _warn_of_zeros(base: sqlite3.Connection, file: BagFile) -> None:
    """Warn of pages that were never written, which SQLite may pass over in silence."""
    with file.content.open("rb") as raw:
        zeros = file.content.stat().st_size - written_bytes(raw)
    if zeros < _FEW_ZEROS or _log_of(file) is not None:
        return
    try:
        (verdict,) = base.execute("PRAGMA quick_check(1)").fetchone()
    except sqlite3.DatabaseError as cause:
        verdict = str(cause)
    if verdict != "ok":
        text = f"{file.name} ends in {zeros} zeros: it is cut or damaged, and messages are missing"
        warnings.warn(text, stacklevel=2)


def _log_of(file: BagFile) -> Path | None:
    """The write-ahead log that a killed recorder has left."""
    log = file.name.with_name(f"{file.name.name}-wal")
    return log if file.content == file.name and log.is_file() and log.stat().st_size > 0 else None


def _page_bytes(file: BinaryIO) -> int:
    """Size of a page, by the header of a data base; 0 where it is damaged."""
    (page,) = _PAGE_BYTES.unpack_from(file.read(_HEADER_BYTES).ljust(_HEADER_BYTES, b"\0"), _PAGE_AT)
    return 2**16 if page == 1 else int(page)


def _rows(
    base: sqlite3.Connection, file: BagFile, connections: Sequence[Connection]
) -> Iterator[tuple[Connection, int, bytes]]:
    """The messages of a data base, in the order of writing; of a damaged one those before the damage."""
    topics = {
        number: topic for number, topic in _topics(base).items() if topic in connections or not connections
    }
    listed = ",".join(str(int(number)) for number in topics)
    query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({listed}) ORDER BY rowid"  # noqa: S608
    count = 0
    try:
        for number, time_ns, raw in base.execute(query):
            yield topics[number], int(time_ns), bytes(raw)
            count += 1
    except sqlite3.DatabaseError as cause:
        if not count:
            raise
        warnings.warn(
            f"{file.name} is cut or damaged ({cause}): read up to message {count} of these topics",
            stacklevel=2,
        )


@contextmanager
def _opened(file: BagFile) -> Iterator[sqlite3.Connection]:
    """Open a data base for reading, also one that is shorter than it says.

    What a killed recorder has left in a write-ahead log beside it (`-wal`) is read too.
    """
    with _whole_pages(file.content) as content:
        how = "immutable=1" if _log_of(file) is None else "mode=ro"
        with closing(sqlite3.connect(f"{content.absolute().as_uri()}?{how}", uri=True)) as base:
            limit_values(base, LARGEST_CHUNK_BYTES)
            try:
                base.execute("PRAGMA writable_schema=ON")  # else SQLite refuses a file that is cut
                check_tables(base)
                _check_bag(base, file)
                yield base
            except sqlite3.DatabaseError as cause:
                remedy = f"Try to repair it: sqlite3 {file.name} .recover | sqlite3 repaired.db3"
                remedy += ". What is empty then was cut before its first message"
                raise InputError(file.name, None, f"damaged, {cause}", remedy) from cause


def _check_bag(base: sqlite3.Connection, file: BagFile) -> None:
    """Check that a data base that is whole has the tables of a bag."""
    names = {str(name) for (name,) in base.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if names and "topics" not in names:
        problem = f"a data base with the tables {brief(sorted(names))}, and none of topics, as bags have"
        remedy = "If it is a simulation of JuPedSim, give it a name that ends in .sqlite"
        raise InputError(file.name, None, problem, remedy)


@contextmanager
def _whole_pages(path: Path) -> Iterator[Path]:
    """A data base without the page in which it is cut, whose missing bytes SQLite would take for zeros."""
    size = path.stat().st_size
    with path.open("rb") as file:
        page = _page_bytes(file)
        if not page or not size % page:
            yield path
            return
        with tempfile.TemporaryDirectory(prefix="pedpred-bag-") as scratch:
            whole = Path(scratch, path.name)
            with whole.open("wb") as copy:
                file.seek(0)
                shutil.copyfileobj(file, copy)
                copy.truncate(size - size % page)
            yield whole


def _topics(base: sqlite3.Connection) -> dict[int, Connection]:
    rows = base.execute("SELECT id, name, type, serialization_format FROM topics")
    return {number: Connection.of(str(name), str(kind), str(form)) for number, name, kind, form in rows}
