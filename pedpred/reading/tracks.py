"""Table -> tracks: people, ids, seconds and metres, once for all formats."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from pedpred.reading.errors import ContentError, row_error
from pedpred.reading.names import TrackNames, is_missing, number_ids
from pedpred.reading.options import FASTEST_HZ, PIXELS, SLOWEST_HZ, UNITS, ReadOptions, is_same_rate
from pedpred.reading.pixels import on_ground
from pedpred.reading.table import Table
from pedpred.reading.text import numbers, seconds, whole_numbers
from pedpred.scenes import Trajectories
from pedpred.scenes.people import PERSON_CLASSES, is_person
from pedpred.storage.tracks import TRACK_COLUMNS, tracks_of

NO_RATE = (
    "the frame rate is unknown",
    "Give it: --rate (rate_hz), frame_rate_hz of a place, or a first line `# framerate: 16`",
)
_SHOWN = 5
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Tracks:
    """People, and the names of their tracks where ids are words."""

    people: Trajectories
    names: TrackNames = field(default_factory=TrackNames)


def to_tracks(file: str, table: Table, options: ReadOptions) -> Tracks:
    """Convert the rows of a file to tracks in metres and seconds.

    Args:
        file: its name, for messages.
        table: its rows.
        options: what the file does not contain.

    Raises:
        ContentError: a value is wrong, a person is at two places at once, or rate or unit are unknown.
    """
    rows, before = table.rows, table.before
    kept = _find_people(file, rows, options)
    x, y = (numbers(rows[axis], axis, before) for axis in "xy")
    position = np.stack([x, y], axis=-1)
    placed, unnamed = np.isfinite(x) & np.isfinite(y), is_missing(rows["id"])
    _warn_dropped(file, kept & ~placed & ~unnamed, before, "without a position")
    kept &= placed
    if kept.any() and unnamed[kept].all():
        raise ContentError("the id is missing in all rows", "Name the column: --columns id=TITLE")
    _warn_dropped(file, kept & unnamed, before, "with a position and no id")
    kept &= ~unnamed
    track_id, names = number_ids(rows["id"], ~kept)
    if names.of_number:
        shown = ", ".join(f"{text} is {number}" for number, text in list(names.of_number.items())[:_SHOWN])
        _log.info("%s: ids are words; they get numbers: %s", file, shown)
    untracked = _find_untracked(track_id, kept, names)
    _warn_dropped(file, untracked, before, "with id -1 (not tracked)")
    kept &= ~untracked
    metres, time_s = _in_metres(position, kept, table, options), _seconds(kept, table, options)
    copies = _find_copies(time_s, track_id, metres, kept, names, before)
    _warn_dropped(file, copies, before, "that repeat another one")
    kept &= ~copies
    index = slice(None) if kept.all() else kept  # most files are kept as a whole
    columns = {"time_s": time_s[index], "track_id": track_id[index]}
    columns |= dict(zip(("x_m", "y_m"), metres[index].T, strict=True))
    for name in set(rows.column_names) & set(TRACK_COLUMNS) - set(columns):
        column = rows[name]
        is_id = name.endswith("_id")
        values = number_ids(column, is_missing(column))[0] if is_id else numbers(column, name, before)
        columns[name] = values[index]
    return Tracks(tracks_of(columns, Path(file)), names)


def _warn_dropped(file: str, dropped: np.ndarray, before: int | None, what: str) -> None:
    """Warn of rows that are left out. [M] bool."""
    if dropped.any():
        where = _place(int(dropped.argmax()), before)
        _log.warning("%s: dropped %d rows %s, the first in %s", file, dropped.sum(), what, where)


def _place(row: int, before: int | None) -> str:
    return f"row {row + 1}" if before is None else f"line {before + row + 1}"


def _find_people(file: str, rows: pa.Table, options: ReadOptions) -> np.ndarray:
    """Which rows are of the classes that are people. [M] bool.

    Raises:
        ContentError: none is, or there is no column of classes to choose from.
    """
    if "class" not in rows.column_names:
        if options.classes not in ((), ("",)):
            raise ContentError("no column holds classes to choose from", "Name it: --columns class=TITLE")
        return np.ones(rows.num_rows, bool)
    labels = pd.Series(rows["class"].cast(pa.string()).to_pandas()).str.strip().fillna("")
    counts = labels.value_counts()
    people = [label for label in counts.index if is_person(label, options.classes or PERSON_CLASSES)]
    if not options.classes and len(counts) == 1 and counts.index[0].isdecimal():
        people = list(counts.index)  # all rows share one number: it does not separate people from others
    others = ", ".join(f"{count} of {label!r}" for label, count in counts.items() if label not in people)
    if not any(people):
        problem = f"no row has the class {' or '.join(options.classes) or 'person'}; there are {others[:200]}"
        raise ContentError(problem, "Give the classes of people: --class")
    if others:
        _log.warning("%s: dropped rows of other classes: %s", file, others[:200])
    return np.array(labels.isin(people), bool)


def _find_untracked(track_id: np.ndarray, kept: np.ndarray, names: TrackNames) -> np.ndarray:
    """Which rows have the id -1, unless all have, or other ids are negative, too. [M] bool."""
    number = next((number for number, text in names.of_number.items() if text == "-1"), -1)
    untracked = kept & (track_id == number)
    others = track_id[kept & ~untracked]
    return untracked if len(others) and others.min() >= 0 else np.zeros_like(kept)


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
    rate_hz = given if found is None else found
    if rate_hz is None:
        raise ContentError(*NO_RATE)
    if given is not None and not is_same_rate(rate_hz, given):
        problem = f"{rate_hz:g} frames per second in the file, {given:g} by --rate"
        raise ContentError(problem, "Leave --rate out")
    if not SLOWEST_HZ <= rate_hz <= FASTEST_HZ:
        problem = f"{rate_hz:g} is not a frame rate, which is from {SLOWEST_HZ:g} to {FASTEST_HZ:g} Hz"
        raise ContentError(problem)
    return rate_hz


def _in_metres(position: np.ndarray, kept: np.ndarray, table: Table, options: ReadOptions) -> np.ndarray:
    unit = agreed_unit(table.unit, options)
    if unit == PIXELS:
        return on_ground(options, position, kept, table.before)
    return position if unit == "m" else position * UNITS[unit]


def _seconds(kept: np.ndarray, table: Table, options: ReadOptions) -> np.ndarray:
    """Times of all rows, s. [M].

    Raises:
        ContentError: one that is kept is missing, or its frame is no whole number.
    """
    before = table.before
    if "frame" in table.rows.column_names:
        frames = np.where(kept, numbers(table.rows["frame"], "frame", before), 0.0)
        return np.asarray(whole_numbers(frames, "frame", before) / agreed_rate(table.rate_hz, options))
    if options.rate_hz is not None:
        remedy = "Leave --rate out, or name the frames: --columns frame=TITLE"
        raise ContentError("the file has times", remedy)
    time_s = seconds(table.rows["time"], "time", before) * table.clock_s
    for row in np.flatnonzero(kept & np.isnan(time_s))[:1]:
        raise row_error(row, before, "time is missing")
    return time_s


def _find_copies(
    time_s: np.ndarray,
    track_id: np.ndarray,
    position: np.ndarray,
    kept: np.ndarray,
    names: TrackNames,
    before: int | None,
) -> np.ndarray:
    """Which of the rows that are kept repeat an earlier one. [M] bool.

    Raises:
        ContentError: a person is at two places at once; it names both lines.
    """
    order = np.lexsort((time_s, track_id))  # stable: the earlier line comes first
    order = order if kept.all() else order[kept[order]]
    again = (np.diff(track_id[order]) == 0) & (np.diff(time_s[order]) == 0)
    first, second = order[:-1][again], order[1:][again]
    apart = np.flatnonzero((position[first] != position[second]).any(axis=-1))
    if len(apart):
        one, other = min(zip(first[apart], second[apart], strict=True), key=lambda pair: pair[1])
        who = names.column(track_id[one][None])[0]
        where = f"at {time_s[one]:.10g} s in {_place(one, before)}"
        remedy = "Make a file for each run, or name the column of ids: --columns id=TITLE"
        raise row_error(other, before, f"id {who} is at another place {where}", remedy)
    copies = np.zeros_like(kept)
    copies[second] = True
    return copies
