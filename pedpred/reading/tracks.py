"""Table -> tracks: people, ids, seconds and metres, once for all formats."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from pedpred.errors import brief
from pedpred.reading.errors import CORRECT, ContentError
from pedpred.reading.names import TrackNames, is_whole
from pedpred.reading.options import FASTEST_HZ, PIXELS, SLOWEST_HZ, UNITS, ReadOptions, is_same_rate
from pedpred.reading.order import check_changes, ids_come_first
from pedpred.reading.pixels import on_ground
from pedpred.reading.table import Table
from pedpred.reading.text import MISSING, numbers, whole_numbers
from pedpred.scenes import Trajectories
from pedpred.scenes.people import PERSON_CLASSES, is_person
from pedpred.storage.tracks import TRACK_COLUMNS, tracks_of

NO_RATE = (
    "the frame rate is unknown",
    "Give it: --rate (rate_hz), frame_rate_hz of a place, or a first line `# framerate: 16`",
)
_LONGEST_NAME, _MOST_NAMES, _SHOWN = 200, 500_000, 5
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Tracks:
    """People, and the names of their tracks where ids are words."""

    people: Trajectories
    names: TrackNames = field(default_factory=TrackNames)


class _Rows(NamedTuple):
    """Rows of a table, and their lines in the file."""

    table: pa.Table
    line: np.ndarray

    def keep(self, kept: np.ndarray) -> _Rows:
        """The rows where `kept` [M] is true."""
        return _Rows(self.table.filter(pa.array(kept)), self.line[kept])


def to_tracks(file: str, table: Table, options: ReadOptions) -> Tracks:
    """Convert the rows of a file to tracks in metres and seconds.

    Args:
        file: its name, for messages.
        table: its rows.
        options: what the file does not contain.

    Raises:
        ContentError: a value is wrong, a person is at two places at once, or rate or unit are unknown.
    """
    line = np.arange(table.rows.num_rows) + 1 + (table.before or 0)
    rows = _people_in(file, _Rows(table.rows, line), options)
    rows, x, y = _with_positions(file, rows, table)
    if not len(x):
        return Tracks(Trajectories(np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 2))))
    if table.open_order:
        check_changes(x, y)
        rows = _ordered(rows, x, y, table)
    track_id, names, tracked = _identities(file, rows)
    if not tracked.all():
        rows, track_id, x, y = rows.keep(tracked), track_id[tracked], x[tracked], y[tracked]
    x, y = _in_metres(x, y, rows.line, agreed_unit(table.unit, options), options)
    time_s = _seconds(rows, table, options)
    kept = _without_copies(file, time_s, track_id, (x, y), rows.line, names, table)
    columns = {"time_s": time_s, "track_id": track_id, "x_m": x, "y_m": y}
    for name in set(rows.table.column_names) & set(TRACK_COLUMNS) - set(columns):
        column = rows.table[name]
        is_id = name.endswith("_id")
        columns[name] = number_ids(column, is_missing(column))[0] if is_id else numbers(column, name)
    return Tracks(tracks_of({name: values[kept] for name, values in columns.items()}, Path(file)), names)


def _people_in(name: str, rows: _Rows, options: ReadOptions) -> _Rows:
    """The rows of the classes that are people."""
    if "class" not in rows.table.column_names:
        if options.classes not in ((), ("",)):
            raise ContentError("no column holds classes to choose from", "Name it: --columns class=TITLE")
        return rows
    column = rows.table["class"].cast(pa.string())
    counts = pd.Series(column.to_pandas()).str.strip().fillna("").value_counts()
    wanted = options.classes or PERSON_CLASSES
    people = [label for label in counts.index if is_person(label, wanted)]
    if not options.classes and len(counts) == 1 and counts.index[0].isdecimal():
        people = list(counts.index)  # all rows share one number: it does not separate people from others
    listed = ", ".join(f"{count} of {label!r}" for label, count in counts.items() if label not in people)
    if not any(people):
        what = " or ".join(options.classes) or "person"
        problem = f"no row has the class {what}; there are {listed[:200]}"
        raise ContentError(problem, "Give the classes of people: --class")
    if len(people) == len(counts):
        return rows
    _log.warning("%s: dropped rows of other classes: %s", name, listed[:200])
    kept = pd.Series(column.to_pandas()).str.strip().fillna("").isin(people).to_numpy()
    return rows.keep(kept)


def _with_positions(name: str, rows: _Rows, table: Table) -> tuple[_Rows, np.ndarray, np.ndarray]:
    """Drop the rows without x and y; if they have an id, they are missing detections."""
    with _line_numbers(rows, table):
        x, y = (numbers(rows.table[axis], axis, 0) for axis in "xy")
    placed = np.isfinite(x) & np.isfinite(y)
    if placed.all():
        return rows, x, y
    lost = ~placed & ~is_missing(rows.table["id"])
    if lost.any():
        text = "%s: dropped %d rows without a position, the first in line %d"
        _log.warning(text, name, lost.sum(), rows.line[lost][0])
    return rows.keep(placed), x[placed], y[placed]


def is_missing(column: pa.ChunkedArray) -> np.ndarray:
    """Which values of a column are missing. [M] bool."""
    values = column.combine_chunks()
    if pa.types.is_dictionary(values.type):
        texts = values.dictionary.to_pylist()
        missing = np.array([str(text).strip().lower() in MISSING for text in texts] or [False])
        return missing[values.indices.fill_null(0).to_numpy(zero_copy_only=False)] | _is_null(values.indices)
    if pa.types.is_string(values.type) or pa.types.is_large_string(values.type):
        return is_missing(pa.chunked_array([values.dictionary_encode()]))
    return _is_null(values)


def _is_null(values: pa.Array) -> np.ndarray:
    return np.asarray(pc.is_null(values, nan_is_null=True).to_numpy(zero_copy_only=False), bool)


def _ordered(rows: _Rows, x: np.ndarray, y: np.ndarray, table: Table) -> _Rows:
    """Name the first two columns, `id` and `frame` or `time`, in the order that fits human motion."""
    first, second = rows.table["id"], rows.table["frame"]
    try:
        values = [
            numbers(column, title, table.before) for column, title in ((first, "id"), (second, "frame"))
        ]
    except ContentError:  # words: the other column holds frames
        values = []
    fractions = [bool((value != np.rint(value)).mean() > 0.25) for value in values] or [False, False]
    if not values:
        ids_first = not _are_numbers(first)
    elif any(fractions):
        ids_first = fractions[1]
    else:
        ids_first = ids_come_first(values[0], values[1], np.stack([x, y], -1))
    names = ["id", "time" if any(fractions) else "frame"]
    _log.info("columns, ordered by how people move: %s, x, y", ", ".join(names if ids_first else names[::-1]))
    one, other = (first, second) if ids_first else (second, first)
    return _Rows(pa.table({"id": one, names[1]: other}), rows.line)


def _are_numbers(column: pa.ChunkedArray) -> bool:
    try:
        numbers(column, "")
    except ContentError:
        return False
    return True


def _identities(name: str, rows: _Rows) -> tuple[np.ndarray, TrackNames, np.ndarray]:
    """Ids as numbers [M], names of the tracks, and which rows have the id of a tracked person [M]."""
    missing = is_missing(rows.table["id"])
    if missing.all():
        raise ContentError("the id is missing in all rows", "Name the column: --columns id=TITLE")
    if missing.any():
        text = "%s: dropped %d rows with a position and no id, the first in line %d"
        _log.warning(text, name, missing.sum(), rows.line[missing][0])
    track_id, names = number_ids(rows.table["id"], missing)
    if names.of_number:
        shown = ", ".join(f"{text} is {number}" for number, text in list(names.of_number.items())[:_SHOWN])
        _log.info("%s: ids are words; they get numbers: %s", name, shown)
    untracked = [number for number, text in names.of_number.items() if text == "-1"] or [-1]
    lost = np.isin(track_id, untracked) & ~missing
    if lost.any() and not lost[~missing].all() and not (track_id[~missing & ~lost] < 0).any():
        text = "%s: dropped %d rows with id -1 (not tracked), the first in line %d"
        _log.warning(text, name, lost.sum(), rows.line[lost][0])
        return track_id, names, ~missing & ~lost
    return track_id, names, ~missing


def number_ids(column: pa.ChunkedArray, missing: np.ndarray) -> tuple[np.ndarray, TrackNames]:
    """Number ids: whole numbers keep their values; words are numbered in the order of appearance.

    Args:
        column: ids, as text or numbers.
        missing: rows without one. [M] bool

    Returns:
        [M] int64, arbitrary where an id is missing; and the names of the tracks.

    Raises:
        ContentError: ids are numbers with fractions, too long or too many.
    """
    encoded = column.combine_chunks()
    encoded = encoded if pa.types.is_dictionary(encoded.type) else encoded.dictionary_encode()
    place = encoded.indices.fill_null(0).to_numpy(zero_copy_only=False)
    if len(encoded.dictionary) > _MOST_NAMES:
        remedy = "Is the right column used as id? Name it: --columns id=TITLE"
        raise ContentError(f"{len(encoded.dictionary)} different ids, at most {_MOST_NAMES}", remedy)
    written = [_written(value) for value in encoded.dictionary.to_pylist()]
    used, first = np.unique(place[~missing], return_index=True)
    of_place = np.zeros(max(1, len(written)), np.int64)
    if all(is_whole(written[k]) for k in used):
        of_place[used] = [int(written[k]) for k in used]
        return of_place[place], TrackNames()
    called = list(dict.fromkeys(written[k] for k in used[np.argsort(first)]))
    _check_names(called)
    number_of = {text: number for number, text in enumerate(called)}
    of_place[used] = [number_of[written[k]] for k in used]
    names = TrackNames()
    names.add(called)
    return of_place[place], names


def _written(value: object) -> str:
    """An id as text; whole numbers have no point."""
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    if isinstance(value, str):
        text = value.strip()
        try:
            number = float(text)
        except ValueError:
            return text
        return str(int(number)) if "." in text and number.is_integer() and "_" not in text else text
    return str(value)


def _check_names(called: list[str]) -> None:
    """Check that ids are names, not numbers with fractions.

    Raises:
        ContentError: they are not.
    """
    if long := [text for text in called if len(text) > _LONGEST_NAME]:
        raise ContentError(f"an id of {len(long[0])} characters, expected at most {_LONGEST_NAME}")
    try:
        fractions = [text for text in called if not float(text).is_integer()]
    except (ValueError, OverflowError):
        return
    if fractions:
        remedy = "Ids are whole numbers or words. If another column holds them: --columns id=TITLE"
        raise ContentError(f"id = {brief(fractions[0])} is not a whole number", remedy)


def agreed_unit(found: str | None, options: ReadOptions) -> str:
    """The unit of lengths in the file or the options; metres if neither has one.

    Raises:
        ContentError: they differ.
    """
    given = options.lengths
    if found is not None and given is not None and found != given:
        option = "--scale and --homography" if given == PIXELS else "--unit"
        problem = f"lengths are {found} by the file, and {given} by {option}"
        raise ContentError(problem, f"Leave {option} out, or correct the title or comment")
    return found or given or "m"


def agreed_rate(found: float | None, options: ReadOptions) -> float:
    """The frame rate in the file or the options, Hz.

    Raises:
        ContentError: neither has one, they differ, or it is not a rate.
    """
    given = options.rate_hz
    if found is None and given is None:
        raise ContentError(*NO_RATE)
    if found is not None and given is not None and not is_same_rate(found, given):
        raise ContentError(
            f"{found:g} frames per second in the file, {given:g} by --rate", "Leave --rate out"
        )
    rate_hz = found if found is not None else given
    assert rate_hz is not None
    if not SLOWEST_HZ <= rate_hz <= FASTEST_HZ:
        raise ContentError(
            f"{rate_hz:g} is not a frame rate, which is from {SLOWEST_HZ:g} to {FASTEST_HZ:g} Hz"
        )
    return rate_hz


def _in_metres(
    x: np.ndarray, y: np.ndarray, line: np.ndarray, unit: str, options: ReadOptions
) -> tuple[np.ndarray, np.ndarray]:
    if unit == PIXELS:
        ground = on_ground(options, x, y, line)
        return ground[:, 0], ground[:, 1]
    return (x, y) if unit == "m" else (x * UNITS[unit], y * UNITS[unit])


def _seconds(rows: _Rows, table: Table, options: ReadOptions) -> np.ndarray:
    """Times of rows, s: from frames and their rate, from numbers, or from dates of ISO 8601 (Unix time)."""
    if "frame" in rows.table.column_names:
        with _line_numbers(rows, table):
            frame = whole_numbers(numbers(rows.table["frame"], "frame", 0), "frame", 0)
        return np.asarray(frame / agreed_rate(table.rate_hz, options))
    column = rows.table["time"]
    if options.rate_hz is not None:
        raise ContentError(
            "the file has times", "Leave --rate out, or name the frames: --columns frame=TITLE"
        )
    if pa.types.is_timestamp(column.type):
        dates = pd.Series(column.to_pandas())
    else:
        try:
            with _line_numbers(rows, table):
                time = numbers(column, "time", 0) * table.clock_s
        except ContentError as cause:
            remedy = "Write times as seconds, or as 2024-03-05T14:02:07.5 (ISO 8601)"
            try:
                dates = pd.to_datetime(pd.Series(column.to_pylist(), dtype=str), format="ISO8601", utc=True)
            except ValueError:
                raise ContentError(cause.problem, remedy, cause.line) from cause
        else:
            if len(lost := np.flatnonzero(np.isnan(time))):
                raise at_row(table, int(rows.line[lost[0]]), "time is missing", CORRECT)
            return time
    if dates.isna().any():
        raise at_row(table, int(rows.line[dates.isna()][0]), "time is missing", CORRECT)
    naive = dates.dt.tz_convert(None) if dates.dt.tz is not None else dates
    return (naive - pd.Timestamp(0)).to_numpy().astype("timedelta64[ns]").astype(np.int64) / 1e9


def _without_copies(
    name: str,
    time_s: np.ndarray,
    track_id: np.ndarray,
    place: tuple[np.ndarray, np.ndarray],
    line: np.ndarray,
    names: TrackNames,
    table: Table,
) -> np.ndarray | slice:
    """The rows that do not repeat an earlier one. [K].

    Raises:
        ContentError: a person is at two places at once; it names both lines.
    """
    order = np.lexsort((time_s, track_id))  # stable: the earlier line comes first
    again = np.diff(track_id[order]) == 0
    again &= np.diff(time_s[order]) == 0
    if not again.any():
        return slice(None)
    one, other = order[:-1][again], order[1:][again]
    if (apart := np.any([axis[one] != axis[other] for axis in place], axis=0)).any():
        first = np.flatnonzero(apart)[np.argmin(line[other[apart]])]
        name_of_track, when = names.column(track_id[one[first]][None])[0], time_s[one[first]]
        where = "line" if table.before is not None else "row"
        problem = f"id {name_of_track} is at another place at {when:.10g} s in {where} {line[one[first]]}"
        remedy = "Remove one of them; make a file for each run. Or name the column of ids: --columns id=TITLE"
        raise at_row(table, int(line[other[first]]), problem, remedy)
    text = "%s: dropped %d rows that repeat another one, the first in line %d"
    _log.warning(text, name, len(other), line[other].min())
    kept: np.ndarray = np.sort(np.delete(order, np.flatnonzero(again) + 1))
    return kept


@contextmanager
def _line_numbers(rows: _Rows, table: Table) -> Iterator[None]:
    """Convert row numbers in errors to lines of the file; dropped rows count."""
    try:
        yield
    except ContentError as cause:
        if cause.line is None:
            raise
        raise at_row(table, int(rows.line[cause.line - 1]), cause.problem, cause.remedy) from cause


def at_row(table: Table, line: int, problem: str, remedy: str) -> ContentError:
    """An error about a line of a text, or about a row of something else."""
    if table.before is None:
        return ContentError(f"row {line}: {problem}", remedy)
    return ContentError(problem, remedy, line)
