"""Databases of JuPedSim (SQLite): tables `trajectory_data`, `metadata` with `fps`, and `geometry` as WKT.

Version 1 has one geometry; from version 2 on it may change with time, and people may walk in each of them.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from pedpred.errors import SourceError, brief
from pedpred.files import limit_values, translate_errors
from pedpred.scenes import Trajectories
from pedpred.sources.beginnings import Beginning
from pedpred.sources.frames import agreed_rate, tracks_in_frames
from pedpred.sources.geometry_wkt import parse_wkt
from pedpred.sources.walls import Walls
from pedpred.storage.tracks import MOST_NUMBERS
from pedpred.tables.options import TableOptions

MAGIC = b"SQLite format 3\0"
_COLUMNS = {"frame": "integer", "id": "integer", "pos_x": "real", "pos_y": "real"}
_VERSIONS = ("1", "2", "3")
_BLOCK_ROWS, _MOST_GEOMETRIES = 2**14, 1000
_LONGEST_VALUE_BYTES, _MOST_STEPS, _STEPS_AT_ONCE = 2**24, 500, 10**6


def fits(begins: Beginning) -> bool:
    """Whether a file is a database of SQLite."""
    return begins.raw.startswith(MAGIC)


def read(path: Path, options: TableOptions) -> Trajectories:
    """Read the detections.

    Args:
        path: the file.
        options: its `rate_hz` is used where the file has no `fps`.

    Raises:
        SourceError: the file is damaged, of another program, or its values are wrong.
    """
    with _opened(path) as database:
        _check_columns(path, database, "trajectory_data", list(_COLUMNS))
        _check_version(path, database)
        found = database.execute("SELECT frame, id, pos_x, pos_y FROM trajectory_data")
        parts, count = [], 0
        while block := found.fetchmany(_BLOCK_ROWS):
            parts.append(_numbers(path, block, count))
            count += len(block)
            if count > MOST_NUMBERS // len(_COLUMNS):
                raise SourceError(
                    path, None, f"more than {MOST_NUMBERS // len(_COLUMNS)} rows", "Divide the file"
                )
        if not parts:
            raise SourceError(path, None, "no detections, trajectory_data is empty")
        rate_hz = _rate_hz(path, database, options)
        (frame, track_id), (x, y) = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
        rows = {"line": np.arange(1, count + 1), "frame": frame, "track_id": track_id, "x_m": x, "y_m": y}
        return tracks_in_frames(path, rows, rate_hz, counted="row")


def read_walls(path: Path) -> Walls | None:
    """Read the ground where people walk; None where the file has none.

    Raises:
        SourceError: the geometry cannot be understood.
    """
    with _opened(path) as database:
        if "geometry" not in _tables(database):
            return None
        _check_columns(path, database, "geometry", ["wkt"])
        rows = database.execute("SELECT wkt FROM geometry").fetchmany(_MOST_GEOMETRIES)
        if any(not isinstance(text, str) for (text,) in rows):
            raise SourceError(path, None, "a geometry that is not text")
        texts = [text for (text,) in rows if text.strip()]
        return parse_wkt(path, "\n".join(texts)) if texts else None


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """Open a database of a stranger: read only, with bounds, and nothing in it is run.

    Raises:
        SourceError: it is damaged or still being written, or a query takes too long.
    """
    for journal in (path.with_name(f"{path.name}-wal"), path.with_name(f"{path.name}-journal")):
        if journal.exists() and journal.stat().st_size:
            problem = f"{journal.name} beside it says that it is still being written"
            raise SourceError(path, None, problem, "Let the simulation end, or open it once with sqlite3")
    steps = iter(range(_MOST_STEPS))
    address = f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1"
    with (
        translate_errors(partial(SourceError, path, None)),
        closing(sqlite3.connect(address, uri=True)) as database,
    ):
        database.execute("PRAGMA trusted_schema = OFF")
        limit_values(database, _LONGEST_VALUE_BYTES)
        database.set_progress_handler(lambda: int(next(steps, None) is None), _STEPS_AT_ONCE)
        yield database


def _tables(database: sqlite3.Connection) -> list[str]:
    """Names of the plain tables; views and virtual tables could run queries of their own."""
    rows = database.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table' LIMIT 1000")
    return [name for name, sql in rows if not str(sql).lstrip().upper().startswith("CREATE VIRTUAL")]


def _check_columns(path: Path, database: sqlite3.Connection, table: str, columns: list[str]) -> None:
    tables = _tables(database)
    if table not in tables:
        problem = f"a database of SQLite without a table {table}; it has {', '.join(map(str, tables))[:200]}"
        bag = "topics" in tables and "messages" in tables
        remedy = "A bag of ROS 2: give it a name that ends in .db3" if bag else "JuPedSim writes it"
        raise SourceError(path, None, problem, remedy)
    # A plain column can be computed by an expression only if `table_xinfo` says that it is hidden.
    present = {name: hidden for _, name, *_, hidden in database.execute(f"PRAGMA table_xinfo({table})")}
    for column in columns:
        if present.get(column) != 0:
            problem = f"table {table} has no column {column}; it has {', '.join(present)[:200]}"
            raise SourceError(path, None, problem, "JuPedSim writes it")


def _check_version(path: Path, database: sqlite3.Connection) -> None:
    """Check that the version is known, if the file says one.

    Raises:
        SourceError: columns may mean something else in this version.
    """
    version = _about(path, database, "version")
    if version is not None and str(version).strip() not in _VERSIONS:
        problem = f"version {brief(version)} in the table metadata is not known, only {', '.join(_VERSIONS)}"
        raise SourceError(path, None, problem, "Save the tracks as CSV with the columns time,id,x,y")


def _about(path: Path, database: sqlite3.Connection, key: str) -> Any:
    """What the table metadata says; None: nothing."""
    if "metadata" not in _tables(database):
        return None
    _check_columns(path, database, "metadata", ["key", "value"])
    row = database.execute("SELECT value FROM metadata WHERE key = ?", (key,)).fetchone()
    return None if row is None else row[0]


def _numbers(path: Path, block: list[tuple[object, ...]], before: int) -> tuple[np.ndarray, np.ndarray]:
    """Frames and ids [2, M] int64, positions [2, M] float64."""
    for row, values in enumerate(block):
        for name, value in zip(_COLUMNS, values, strict=True):
            whole = _COLUMNS[name] == "integer"
            if type(value) is not int and (whole or type(value) is not float):
                what = "a whole number" if whole else "a number"
                problem = f"row {before + row + 1} of trajectory_data: {name} = {brief(value)} is not {what}"
                raise SourceError(path, None, problem)
    frame, track_id, x, y = zip(*block, strict=True)
    return np.array([frame, track_id], dtype=np.int64), np.array([x, y], dtype=np.float64)


def _rate_hz(path: Path, database: sqlite3.Connection, options: TableOptions) -> float:
    """The rate that the file or the caller says; errors of `agreed_rate`."""
    said = None
    if (written := _about(path, database, "fps")) is not None:
        try:
            said = float(written)
        except (TypeError, ValueError) as cause:
            raise SourceError(path, None, f"fps in the table metadata: {cause}") from cause
    return agreed_rate(path, said, options, "no fps in the table metadata")
