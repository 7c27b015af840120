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

import numpy as np
import pyarrow as pa

from pedpred.errors import brief
from pedpred.files import limit_values
from pedpred.reading.errors import ContentError
from pedpred.reading.geometry import Geometry, parse_wkt
from pedpred.reading.head import Head
from pedpred.reading.options import ReadOptions
from pedpred.reading.table import Table
from pedpred.storage.tracks import MOST_NUMBERS

NAME = "JuPedSim database"
_COLUMNS: dict[str, Any] = {"frame": int, "id": int, "pos_x": (int, float), "pos_y": (int, float)}
_VERSIONS = ("1", "2", "3")
_BLOCK_ROWS, _MOST_ROWS, _MOST_GEOMETRIES = 2**14, MOST_NUMBERS // 4, 1000
_LONGEST_VALUE_BYTES, _MOST_STEPS, _STEPS_AT_ONCE = 2**24, 500, 10**6


def recognises(head: Head) -> bool:
    """Whether a file is a database of SQLite."""
    return head.raw.startswith(b"SQLite format 3\0")


def read(path: Path, options: ReadOptions) -> Table:
    """Read the detections, and what reads the geometry.

    Raises:
        ContentError: the file is damaged, of another program, or its values are wrong.
    """
    with _opened(path) as database:
        _check_columns(database, "trajectory_data", list(_COLUMNS))
        version = _metadata(database, "version")
        if version is not None and str(version).strip() not in _VERSIONS:
            problem = (
                f"version {brief(version)} in the table metadata is not known, only {', '.join(_VERSIONS)}"
            )
            raise ContentError(problem, "Save the tracks as CSV with the columns time,id,x,y")
        found = database.execute("SELECT frame, id, pos_x, pos_y FROM trajectory_data")
        parts: list[tuple[np.ndarray, np.ndarray]] = []
        while block := list(islice(found, _BLOCK_ROWS)):
            parts.append(_numbers(block, len(parts) * _BLOCK_ROWS))
            if len(parts) * _BLOCK_ROWS > _MOST_ROWS + _BLOCK_ROWS:
                raise ContentError(f"more than {_MOST_ROWS} rows", "Divide the file")
        if not parts:
            raise ContentError("no detections, trajectory_data is empty")
        fps = _metadata(database, "fps")
        (frame, who), (x, y) = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
    rate_hz = None if fps is None else float(fps)
    rows = pa.table({"frame": frame, "id": who, "x": x, "y": y})
    return Table(rows, "m", rate_hz, walls=partial(_read_walls, path))


def _read_walls(path: Path) -> Geometry | None:
    """The ground where people walk; None where the file has none."""
    with _opened(path) as database:
        if "geometry" not in _tables(database):
            return None
        _check_columns(database, "geometry", ["wkt"])
        rows = database.execute("SELECT wkt FROM geometry").fetchmany(_MOST_GEOMETRIES)
    if any(not isinstance(text, str) for (text,) in rows):
        raise ContentError("a geometry that is not text")
    texts = [text for (text,) in rows if text.strip()]
    return parse_wkt("\n".join(texts)) if texts else None


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
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


def _check_columns(database: sqlite3.Connection, table: str, columns: list[str]) -> None:
    tables = _tables(database)
    if table not in tables:
        problem = f"a database of SQLite without a table {table}; it has {', '.join(map(str, tables))[:200]}"
        bag = "topics" in tables and "messages" in tables
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
    _check_columns(database, "metadata", ["key", "value"])
    row = database.execute("SELECT value FROM metadata WHERE key = ?", (key,)).fetchone()
    return None if row is None else row[0]


def _numbers(block: list[tuple[object, ...]], before: int) -> tuple[np.ndarray, np.ndarray]:
    """Frames and ids [2, M] int64, positions [2, M] float64."""
    for row, values in enumerate(block, start=before + 1):
        for (name, kind), value in zip(_COLUMNS.items(), values, strict=True):
            if not isinstance(value, kind):
                what = "a whole number" if kind is int else "a number"
                raise ContentError(f"row {row} of trajectory_data: {name} = {brief(value)} is not {what}")
    frame, who, x, y = zip(*block, strict=True)
    return np.array([frame, who], dtype=np.int64), np.array([x, y], dtype=np.float64)
