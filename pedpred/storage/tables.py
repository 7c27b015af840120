"""Tables of tracks as text: a line per detection, columns named by a header or by the caller.

Separators are commas, semicolons, tabs or blanks; lines that begin with `#` are comments, unless they are the
header. Columns with other names than those of `NAMES` and of `Trajectories` are not used. Lengths are metres
unless the titles of x and y, such as `x [cm]` or `y_mm`, or the caller say otherwise. Ids may be words, which
are numbered.
"""

from __future__ import annotations

import csv
import logging
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError, ValueRuleError
from pedpred.fields import check_choice
from pedpred.files import translate_errors
from pedpred.scenes import Trajectories
from pedpred.scenes.scene import LATEST_S
from pedpred.storage.text import Row, check_unique, read_numbers, text_lines
from pedpred.storage.tracks import TRACK_COLUMNS, tracks_of

NAMES = {
    "time_s": ("t", "time", "time_s", "timestamp"),
    "time_ms": ("t_ms", "time_ms", "timestamp_ms"),
    "frame": ("frame", "frame_id"),
    "track_id": ("id", "track", "track_id", "ped_id", "agent_id"),
    "x_m": ("x", "x_m", "pos_x"),
    "y_m": ("y", "y_m", "pos_y"),
}
"""What the columns may be called; upper and lower case are the same."""

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
"""Units of length by their names in files, m."""

SLOWEST_HZ, FASTEST_HZ = 1e-3, 1e6
"""Rates of frames that a table may have."""

IN_SECONDS = "Times are seconds; call the column time_ms, or frame and give --rate"

_KNOWN = {alias: name for name, aliases in NAMES.items() for alias in aliases}
_KNOWN |= {name: name for name in TRACK_COLUMNS}
_LENGTHS = ("x_m", "y_m")
_WITH_UNIT = re.compile(r"(.*?)\s*[ _/\[(]\s*(cm|mm|m)[\])]?")
_SHOWN_NAMES = 3
_log = logging.getLogger(__name__)
_CLOCKS = ("time_s", "time_ms", "frame")
_SEPARATORS = {";": "semicolons", "\t": "tabs", ",": "commas"}
_PARTS = {"nanoseconds": 1e9, "microseconds": 1e6}
_LONG_AGO_S = 1e8  # Unix times are later
_LARGEST_PIXEL_M = 10.0


@dataclass(frozen=True)
class TableOptions:
    """What a table does not say itself.

    Attributes:
        columns: their names in order, in place of a header; None: the header has them.
        rate_hz: of frame numbers; None: the file says it, or has times.
        unit: of lengths, a key of `UNITS`; None: the file says it, or they are metres.
        pixel_m: side of a pixel, m, where people were annotated in a picture.
    """

    columns: tuple[str, ...] | None = None
    rate_hz: float | None = None
    unit: str | None = None
    pixel_m: float | None = None

    def __post_init__(self) -> None:
        if self.columns is not None:
            titles_of_tracks(self.columns)
        if self.rate_hz is not None and not SLOWEST_HZ <= self.rate_hz <= FASTEST_HZ:
            raise ValueRuleError("rate_hz", self.rate_hz, "it must be a number from 0.001 to 1000000 Hz")
        if self.unit is not None:
            check_choice("unit", self.unit, list(UNITS))
        if self.pixel_m is not None and not 0.0 < self.pixel_m <= _LARGEST_PIXEL_M:
            raise ValueRuleError(
                "pixel_m", self.pixel_m, f"it must be positive, at most {_LARGEST_PIXEL_M} m"
            )


def read_table(path: Path, options: TableOptions | None = None) -> Trajectories:
    """Read the detections in a table.

    Args:
        path: the file.
        options: what it does not say itself.

    Raises:
        SourceError: it is no such table; it names the line and the value, or what was found as header.
    """
    options = options or TableOptions()
    header, rows = _opened(path, options)
    return tracks_in_rows(path, header, rows, options)


def tracks_in_rows(
    path: Path, header: Sequence[str], rows: Iterator[Row], options: TableOptions
) -> Trajectories:
    """Read the detections in rows of text, from whatever file.

    Args:
        path: the file, for errors.
        header: titles of the columns, as a table has them.
        rows: the lines after the header.
        options: what they do not say themselves.

    Raises:
        SourceError: columns are missing, or a value is wrong; it names the line.
    """
    try:
        wanted = titles_of_tracks(header)
    except ValueRuleError as cause:
        raise SourceError(
            path, None, cause.rule, "Rename columns, or name all in order: --columns"
        ) from cause
    (id_title,) = (title for title, name in wanted.items() if name == "track_id")
    rows = _with_numbered_ids(path, rows, header.index(id_title), [header.index(title) for title in wanted])
    columns = read_numbers(path, rows, header, wanted)
    for name in _LENGTHS:
        columns[name] *= UNITS[_unit(path, wanted, options.unit)]
    with translate_errors(lambda problem: SourceError(path, None, problem)):
        _set_time(path, columns, options.rate_hz)
        check_unique(path, columns, "track_id", "time_s")
        del columns["line"]
        return tracks_of(columns, path)


def has_header(path: Path) -> bool:
    """Whether the first line that is no comment begins with a word.

    Raises:
        SourceError: the file is missing or no text.
    """
    first = next((text for _, text in text_lines(path) if not text.startswith("#")), "0")
    return not _is_number(_split(first, _separator(first))[0])


def _opened(path: Path, options: TableOptions) -> tuple[Sequence[str], Iterator[Row]]:
    """Find the titles of the columns; the rows are read on demand."""
    lines = text_lines(path)
    for line, text in lines:
        separator = _separator(text)
        titles = [title.strip() for title in _split(text.lstrip("#"), separator)]
        if text.startswith("#") and (options.columns or not _names_tracks(titles)):
            continue
        is_header = not _holds_numbers(titles, options.columns)
        if not is_header and options.columns is None:
            problem = f"no header, the first line is {text.strip()[:80]!r}"
            raise SourceError(path, line, problem, "Name the columns in order, such as --columns time,id,x,y")
        given = lines if is_header else chain([(line, text)], lines)
        rows = ((n, _split(other, separator)) for n, other in given if not other.startswith("#"))
        return options.columns or titles, rows
    raise SourceError(path, None, "no detections, the file is empty")


def _holds_numbers(fields: Sequence[str], columns: Sequence[str] | None) -> bool:
    """Whether a line is no header: all its fields are numbers, or one in a column that the caller names."""
    if columns is None:
        return all(map(_is_number, fields))
    return any(
        _is_number(field)
        for title, field in zip(columns, fields, strict=False)
        if title in titles_of_tracks(columns)
    )


def _separator(text: str) -> str | None:
    return next((separator for separator in _SEPARATORS if separator in text), None)


def _split(text: str, separator: str | None) -> Sequence[str]:
    """Fields of a line; None: blanks separate them."""
    if '"' in text:
        return next(csv.reader([text], delimiter=separator or " ", skipinitialspace=True))
    return text.split(separator)


def _is_number(field: str) -> bool:
    try:
        return np.isfinite(float(field))
    except ValueError:
        return False


def _names_tracks(titles: Sequence[str]) -> bool:
    try:
        return bool(titles_of_tracks(titles))
    except ValueRuleError:
        return False


def _name_of(title: str) -> str | None:
    """The name of a column by its title; those of lengths may say a unit."""
    if name := _KNOWN.get(title.lower()):
        return name
    match = _WITH_UNIT.fullmatch(title.lower())
    name = _KNOWN.get(match[1]) if match else None
    return name if name in _LENGTHS else None


def titles_of_tracks(titles: Sequence[str]) -> dict[str, str]:
    """Title -> name of the columns that hold tracks.

    Raises:
        ValueRuleError: one is missing or there twice.
    """
    named: dict[str, str] = {}
    for title in titles:
        if name := _name_of(title):
            if name in named:
                raise ValueRuleError("columns", titles, f"columns {named[name]} and {title} are both {name}")
            named[name] = title
    clock = next((name for name in _CLOCKS if name in named), "time_s")
    for name in (clock, "track_id", "x_m", "y_m"):
        if name not in named:
            aliases = [alias for n in (_CLOCKS if name == clock else (name,)) for alias in NAMES[n]]
            rule = f"no column for {name}, which may be called {', '.join(aliases)}"
            found = " | ".join(titles)[:200]
            separators = "commas, semicolons, tabs or blanks between them"
            raise ValueRuleError("columns", titles, f"{rule}. Found were {found}; expected {separators}")
    return {title: name for name, title in named.items() if name == clock or name not in _CLOCKS}


def _unit(path: Path, wanted: Mapping[str, str], given: str | None) -> str:
    """The unit of lengths that the titles or the caller say; metres if nobody does.

    Raises:
        SourceError: they differ.
    """
    titles = [title for title, name in wanted.items() if name in _LENGTHS]
    said = {match[2] for title in titles if (match := _WITH_UNIT.fullmatch(title.lower()))}
    units = said | ({given} if given else set())
    if len(units) > 1:
        found = " and ".join(sorted(units))
        raise SourceError(path, None, f"lengths are said to be {found}", "Correct titles or --unit")
    return units.pop() if units else "m"


def _with_numbered_ids(path: Path, rows: Iterator[Row], at: int, used: Sequence[int]) -> Iterator[Row]:
    """Replace ids that are words by numbers in the order of their appearance, if the first one is a word.

    Rows are left out in which only the time is given: they are about something else.
    """
    numbers: dict[str, str] = {}
    words = None
    for line, fields in rows:
        if at >= len(fields):
            yield line, fields
            continue
        name = fields[at].strip()
        if not name and sum(bool(fields[column].strip()) for column in used if column < len(fields)) <= 1:
            continue
        if words is None:
            words = bool(name) and not _is_number(name)
        if words and name:
            fields = [*fields[:at], numbers.setdefault(name, str(len(numbers))), *fields[at + 1 :]]
        yield line, fields
    if numbers:
        shown = ", ".join(f"{name} is {number}" for name, number in list(numbers.items())[:_SHOWN_NAMES])
        _log.info(
            "%s: ids are words, and numbered: %s%s", path, shown, ", ..." * (len(numbers) > _SHOWN_NAMES)
        )


def _set_time(path: Path, columns: dict[str, np.ndarray], rate_hz: float | None) -> None:
    """Make `time_s` of milliseconds or frames."""
    if "time_ms" in columns:
        columns["time_s"] = columns.pop("time_ms") / 1000.0
    elif "frame" in columns:
        if rate_hz is None:
            remedy = "Say how many frames a second has: --rate"
            raise SourceError(path, None, "frame numbers, but no rate", remedy)
        columns["time_s"] = columns.pop("frame") / rate_hz
    largest = np.abs(columns["time_s"]).max(initial=0.0)
    if largest >= LATEST_S:
        unit = next(
            (unit for unit, parts in _PARTS.items() if largest >= _LONG_AGO_S * parts), "milliseconds"
        )
        raise SourceError(path, None, f"the time {largest:.10g} looks like {unit}", IN_SECONDS)
