"""Databases of JuPedSim (SQLite), versions 1 to 3: `trajectory_data`, `fps` in `metadata`, `geometry` as WKT.

    CREATE TABLE trajectory_data (frame INTEGER, id INTEGER, pos_x REAL, pos_y REAL, ori_x REAL, ori_y REAL)

From version 2 on, the geometry may change with time, and people may walk in each of them.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pyarrow as pa

from pedpred.errors import brief
from pedpred.files import limit_values
from pedpred.reading.errors import ContentError
from pedpred.reading.geometry import Geometry, parse_wkt
from pedpred.reading.head import Head
from pedpred.reading.options import ReadOptions
from pedpred.reading.table import Table
from pedpred.reading.text import check_size

NAME = "JuPedSim database"
_ROWS = pa.schema({"frame": pa.int64(), "id": pa.int64(), "x": pa.float64(), "y": pa.float64()})
_VERSIONS = ("1", "2", "3")
_BLOCK_ROWS, _MOST_GEOMETRIES = 2**14, 1000
_LONGEST_VALUE_BYTES, _MOST_STEPS, _STEPS_AT_ONCE = 2**24, 500, 10**6


def recognises(head: Head) -> bool:
    """Whether a file is a database of SQLite."""
    return head.raw.startswith(b"SQLite format 3\0")


def read(path: Path, options: ReadOptions) -> Table:
    """Read the detections, and what reads the geometry.

    Raises:
        ContentError: the file is damaged, of another program, or its values are wrong.
    """
    with _open_database(path) as database:
        _check_columns(database, "trajectory_data", "frame", "id", "pos_x", "pos_y")
        version = _metadata(database, "version")
        if version is not None and str(version).strip() not in _VERSIONS:
            known = ", ".join(_VERSIONS)
            problem = f"version {brief(version)} in the table metadata is not known, only {known}"
            raise ContentError(problem, "Save the tracks as CSV with the columns time,id,x,y")
        found = database.execute("SELECT frame, id, pos_x, pos_y FROM trajectory_data")
        blocks: list[pa.RecordBatch] = []
        while block := list(islice(found, _BLOCK_ROWS)):
            columns = zip(_ROWS, zip(*block, strict=True), strict=True)
            arrays = [pa.array(values, field.type) for field, values in columns]
            blocks.append(pa.record_batch(arrays, schema=_ROWS))
            check_size(sum(map(len, blocks)))
        fps = _metadata(database, "fps")
    rate_hz = None if fps is None else float(fps)
    return Table(pa.Table.from_batches(blocks, _ROWS), "m", rate_hz, walls=partial(_read_walls, path))


def _read_walls(path: Path) -> Geometry | None:
    """The ground where people walk; None where the file has none."""
    with _open_database(path) as database:
        if "geometry" not in _tables(database):
            return None
        _check_columns(database, "geometry", "wkt")
        rows = database.execute("SELECT wkt FROM geometry").fetchmany(_MOST_GEOMETRIES)
    texts = [text for (text,) in rows if str(text).strip()]
    return parse_wkt("\n".join(texts)) if texts else None


@contextmanager
def _open_database(path: Path) -> Iterator[sqlite3.Connection]:
    """Open an untrusted database: read only, with limits, and without running code in it.

    Raises:
        ContentError: it is still being written.
    """
    for journal in (path.with_name(f"{path.name}-wal"), path.with_name(f"{path.name}-journal")):
        if journal.exists() and journal.stat().st_size:
            problem = f"it is still being written: there is {journal.name}"
            raise ContentError(problem, "Let the simulation end, or open it once with sqlite3")
    address = f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1"
    steps = iter(range(_MOST_STEPS))
    with closing(sqlite3.connect(address, uri=True)) as database:
        database.execute("PRAGMA trusted_schema = OFF")
        limit_values(database, _LONGEST_VALUE_BYTES)
        database.set_progress_handler(lambda: int(next(steps, None) is None), _STEPS_AT_ONCE)
        yield database


def _tables(database: sqlite3.Connection) -> list[str]:
    """Names of the plain tables; views and virtual tables could run queries of their own."""
    rows = database.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table' LIMIT 1000")
    return [name for name, sql in rows if not str(sql).lstrip().upper().startswith("CREATE VIRTUAL")]


def _check_columns(database: sqlite3.Connection, table: str, *columns: str) -> None:
    tables = _tables(database)
    if table not in tables:
        problem = f"a database of SQLite without a table {table}; it has {', '.join(map(str, tables))[:200]}"
        bag = {"topics", "messages"} <= set(tables)
        remedy = "A bag of ROS 2: give it a name that ends in .db3" if bag else "JuPedSim writes it"
        raise ContentError(problem, remedy)
    # A plain column can be computed by an expression only if `table_xinfo` says that it is hidden.
    present = {name: hidden for _, name, *_, hidden in database.execute(f"PRAGMA table_xinfo({table})")}
    for column in columns:
        if present.get(column) != 0:
            problem = f"table {table} has no column {column}; it has {', '.join(present)[:200]}"
            raise ContentError(problem, "JuPedSim writes it")


def _metadata(database: sqlite3.Connection, key: str) -> Any:
    """A value of the table metadata; None: it has none."""
    if "metadata" not in _tables(database):
        return None
    _check_columns(database, "metadata", "key", "value")
    row = database.execute("SELECT value FROM metadata WHERE key = ?", (key,)).fetchone()
    return None if row is None else row[0]
