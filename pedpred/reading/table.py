"""Tables of tracks: text with a header or named columns, Parquet, Feather, data frames of pandas.

    time,id,x,y
    0.0,1,3.2,-1.5

Six quantities have known titles (`TITLES`); others are named by `--columns`.
"""

from __future__ import annotations

import csv
import logging
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import dataset

from pedpred.reading.errors import ContentError
from pedpred.reading.geometry import Geometry
from pedpred.reading.head import Head
from pedpred.reading.options import PIXELS, QUANTITIES, UNITS, ReadOptions
from pedpred.reading.order import check_changes, ids_come_first
from pedpred.reading.text import BLANKS, TextForm, check_size, first_lines, numbers, read_columns

NAME = "table"
_PARQUET = b"PAR1"
TITLES = {
    "time": ("time", "t", "timestamp", "time_stamp", "sim_time", "timestep_time", "seconds", "datetime"),
    "frame": ("frame", "frame_id", "frame_number", "frame_no", "frame_index"),
    "id": ("id", "track_id", "ped_id", "pedestrian_id", "person_id", "agent_id", "object_id", "track"),
    "x": ("x", "pos_x", "x_pos", "position_x", "x_position", "person_x", "x_center", "center_x"),
    "y": ("y", "pos_y", "y_pos", "position_y", "y_position", "person_y", "y_center", "center_y"),
    "class": ("class", "type", "label", "category", "agent_type", "object_type", "agent_class", "class_name"),
}
"""Quantity -> titles that are known without `--columns`, the best one first."""
_CLOCKS_S = {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_LENGTHS = {name: name for name in (*UNITS, PIXELS)} | {"metres": "m", "meters": "m", "pixels": PIXELS}
_IN_BRACKETS = re.compile(r"(.+?)\s*(?:[(\[]\s*(\w+)\s*[)\]]|/\s*(\w+))")
_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
_RATES = (
    re.compile(r"(?:frame[ _-]?rate|fps)\W{0,3}(\d+(?:\.\d+)?)", re.IGNORECASE),
    re.compile(r"(\d+(?:\.\d+)?)\s*fps\b", re.IGNORECASE),
)
_LENGTH = r"(m|cm|mm|ft|inch|px)"
_UNITS = (
    re.compile(rf"\b[xy]\s*[/\[(]\s*{_LENGTH}\b", re.IGNORECASE),
    re.compile(rf"\bin {_LENGTH}\W*$", re.IGNORECASE),
)
_COMMENTS, _MOST_COMMENTS = ("#", "%", "//"), 1000
_TRANSPOSED_ROWS, _WIDE = (4, 5), 20
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Table:
    """The rows of a file, before anything is converted.

    Attributes:
        rows: `time` or `frame`, `id`, `x`, `y` and perhaps `class`, as text or numbers; null: missing.
        unit: of x and y, a key of `UNITS` or `PIXELS`; None: not in the file.
        rate_hz: frames per second; None: not in the file.
        walls: reads the geometry inside the file; None: it has none.
        clock_s: what a time of 1 lasts, s.
        before: lines before the first row, for errors; None: the file is no text.
    """

    rows: pa.Table
    unit: str | None = None
    rate_hz: float | None = None
    walls: Callable[[], Geometry | None] | None = None
    clock_s: float = 1.0
    before: int | None = None


@dataclass(frozen=True)
class Columns:
    """Which columns of a table hold what.

    Attributes:
        titles: quantity -> title.
        unit: of lengths, from the titles; None: they have none.
        clock_s: what a time of 1 lasts, s.
    """

    titles: Mapping[str, str]
    unit: str | None = None
    clock_s: float = 1.0


def find_columns(titles: Sequence[str], options: ReadOptions) -> Columns:
    """Find the columns of the six quantities by their titles, or by the caller's.

    Raises:
        ContentError: one is missing, or two columns have its title.
    """
    named = options.columns if isinstance(options.columns, Mapping) else {}
    plain = {title: _plain(title) for title in titles if title not in named.values()}
    by_name = {name: title for title, (name, _) in reversed(plain.items())}
    known = {name: [by_name[one] for one in TITLES[name] if one in by_name] for name in QUANTITIES}
    found = {name: own[0] for name, own in known.items() if own and name not in named} | dict(named)
    if {"time", "frame"} <= set(found):
        del found["time" if "frame" in named and "time" not in named else "frame"]
    clock = "frame" if "frame" in found else "time"
    needed = (clock, "x", "y") if options.one_person_per_file else (clock, "id", "x", "y")
    missing = [name for name in needed if name not in found]
    missing += [name for name, title in found.items() if title not in titles]
    if missing:
        what = ", ".join(missing).replace("time", "time or frame")
        problem = f"no column for {what}; there are {', '.join(titles)[:200] or 'none'}"
        remedy = ",".join(f"{name}=TITLE" for name in missing)
        raise ContentError(problem, f"Name what is missing: --columns {remedy}")
    if repeated := [title for title in found.values() if titles.count(title) > 1]:
        remedy = "Name all columns in order: --columns time,id,x,y"
        raise ContentError(f"several columns {repeated[0]!r}", remedy)
    unit_of = {name: _plain(title)[1] for name, title in found.items()}
    units = {_LENGTHS[unit_of[axis]] for axis in "xy" if unit_of[axis] in _LENGTHS}
    if len(units) > 1:
        raise ContentError(f"x and y have the units {' and '.join(sorted(units))}", "Correct the titles")
    return Columns(found, next(iter(units), None), _CLOCKS_S.get(unit_of.get("time", ""), 1.0))


def _plain(title: str) -> tuple[str, str]:
    """A title in small letters with `_` between its words, and the unit at its end, if it is one."""
    match = _IN_BRACKETS.fullmatch(title.strip())
    name, unit = (match[1], (match[2] or match[3]).lower()) if match else (title.strip(), "")
    name = re.sub(r"[\s.:_-]+", "_", _CAMEL.sub("_", name)).lower().strip("_")
    first, _, last = name.rpartition("_")
    if not unit and first and last in {*_CLOCKS_S, *_LENGTHS}:
        return first, last
    return name, unit


def read(path: Path, options: ReadOptions, also: Sequence[str] = ()) -> Table:
    """Read a text, Parquet or Feather.

    Args:
        path: the file.
        options: what the file does not contain.
        also: titles of further columns of numbers, which are read where they are there.

    Raises:
        ContentError: columns are missing, or a line has another number of columns.
    """
    if is_columnar(Head.of(path).raw):
        return _read_columnar(path, options)
    form, comments, has_header = text_form(path, options)
    if not has_header and not isinstance(options.columns, tuple):
        return _read_untitled(path, form, comments, options)
    if isinstance(options.columns, tuple):
        form = replace(form, titles=_by_position(options.columns, len(form.titles)))
        columns = Columns({name: name for name in QUANTITIES if name in form.titles})
    else:
        columns = find_columns(form.titles, options)
    _log.info("%s: %s", path, ", ".join(f"{name}: {title}" for name, title in columns.titles.items()))
    unit, rate_hz = find_unit_and_rate(comments)
    wanted = {**columns.titles, **{title: title for title in also if title in form.titles}}
    words = ["id", "class", *(title for title in also if title.endswith("_id"))]
    return Table(
        read_columns(path, form, wanted, words),
        columns.unit or unit,
        rate_hz if "frame" in columns.titles else None,
        clock_s=columns.clock_s,
        before=form.skipped,
    )


def _by_position(columns: Sequence[str], width: int) -> list[str]:
    """The titles of all columns, by the quantities in their order."""
    if len(columns) > width:
        problem = f"{width} columns, but --columns names {len(columns)}"
        raise ContentError(problem, "Name all columns in order, or give --delimiter")
    names = [*columns, *([""] * (width - len(columns)))]
    return [name if name in QUANTITIES else f"column {at}" for at, name in enumerate(names, start=1)]


def _read_untitled(path: Path, form: TextForm, comments: Sequence[str], options: ReadOptions) -> Table:
    """Read `id frame x y` or `frame id x y`, whichever fits how people move."""
    width = len(form.titles)
    if options.columns is not None or options.one_person_per_file:
        raise ContentError(
            "no header, so that no column has a title", "Name all in order: --columns frame,id,x,y"
        )
    if width > _WIDE and len(first_lines(path, _TRANSPOSED_ROWS[1] + 1, form.encoding)) in _TRANSPOSED_ROWS:
        problem = f"a transposed table: few rows with {width} columns each, a column per detection"
        remedy = (
            "Transpose it: pandas.read_csv(FILE, header=None).T.to_csv('rows.csv', header=False, index=False)"
        )
        raise ContentError(problem, f"{remedy}; then name the columns, such as --columns frame,id,y,x")
    if width < 4:
        problem = f"no header, and {width} columns, expected id frame x y"
        raise ContentError(
            problem, "Separate values by blanks, tabs, commas or semicolons, or give --delimiter"
        )
    form = replace(form, titles=_by_position(("id", "frame", "x", "y"), width))
    wanted = {name: name for name in ("id", "frame", "x", "y")}
    rows = read_columns(path, form, wanted, ("id", "frame"))
    names = _order(rows, form.skipped)
    _log.info("%s: columns, ordered by how people move: %s, x, y", path, ", ".join(names))
    unit, rate_hz = find_unit_and_rate(comments)
    return Table(rows.rename_columns([*names, "x", "y"]), unit, rate_hz, before=form.skipped)


def _order(rows: pa.Table, before: int) -> tuple[str, str]:
    """What the first two columns are: `id` and `frame`, or `time` where they have fractions.

    Raises:
        ContentError: the file could be read in both ways, or x or y never changes.
    """
    position = np.stack([rows[axis].to_numpy() for axis in "xy"], axis=-1)
    placed = np.isfinite(position).all(axis=-1)
    check_changes(*position[placed].T)
    try:
        first, second = (numbers(rows[name], name, before)[placed] for name in ("id", "frame"))
    except ContentError:  # one holds words
        return ("frame", "id") if _holds_numbers(rows["id"]) else ("id", "frame")
    fractions = [bool((values != np.rint(values)).mean() > 0.25) for values in (first, second)]
    if any(fractions):
        return ("id", "time") if fractions[1] else ("time", "id")
    return ("id", "frame") if ids_come_first(first, second, position[placed]) else ("frame", "id")


def _holds_numbers(column: pa.ChunkedArray) -> bool:
    try:
        numbers(column, "")
    except ContentError:
        return False
    return True


def text_form(path: Path, options: ReadOptions) -> tuple[TextForm, list[str], bool]:
    """Find out how a text is divided.

    Returns:
        Its form, the comments above the rows, and whether the titles are those of a header.

    Raises:
        ContentError: the file is empty.
    """
    lines = first_lines(path, _MOST_COMMENTS, options.encoding)
    rows = (number for number, line in enumerate(lines) if line.strip() and not line.startswith(_COMMENTS))
    first = next(rows, None)
    if first is None:
        raise ContentError("no detections, the file is empty", "Name a file with tracks")
    comments = [line for line in lines[:first] if line.strip()]
    delimiter = options.delimiter or _delimiter(lines[first])
    fields = _fields(lines[first], delimiter)
    form = TextForm(fields, delimiter, first, options.encoding, options.decimal)
    if not any(map(_is_number, fields)):
        return replace(form, skipped=first + 1), comments, True
    titles = _fields(comments[-1].lstrip("#%/ \t"), delimiter) if comments else []
    if len(titles) == len(fields) and _are_known(titles, options):
        return replace(form, titles=titles), comments, True
    return form, comments, False


def _are_known(titles: Sequence[str], options: ReadOptions) -> bool:
    try:
        find_columns(titles, options)
    except ContentError:
        return False
    return True


def _delimiter(line: str) -> str:
    """The delimiter of a line; blanks where the fields between blanks or tabs are all numbers."""
    found = next((sign for sign in ";,|" if sign in line), None)
    if found is None and "\t" in line and not all(map(_is_number, line.split())):
        return "\t"
    return found or BLANKS


def _fields(line: str, delimiter: str) -> list[str]:
    if delimiter == BLANKS:
        return line.split()
    return [field.strip() for field in next(csv.reader([line], delimiter=delimiter))]


def _is_number(field: str) -> bool:
    try:
        return bool(np.isfinite(float(field.replace(",", "."))))
    except ValueError:
        return False


def find_unit_and_rate(comments: Sequence[str]) -> tuple[str | None, float | None]:
    """The unit of lengths and the frame rate in comments, as PeTrack, JuPedSim and PedPy write them.

    Raises:
        ContentError: there are several.
    """
    rates = {float(match[1]) for text in comments for one in _RATES for match in one.finditer(text)}
    units = {match[1].lower() for text in comments for one in _UNITS for match in one.finditer(text)}
    for what, found in (("frame rates", rates), ("units of lengths", units)):
        if len(found) > 1:
            listed = " and ".join(map(str, sorted(found)))
            raise ContentError(f"the comments name the {what} {listed}", "Correct them")
    return next(iter(units), None), next(iter(rates), None)


def is_columnar(raw: bytes) -> bool:
    """Whether a file that begins like this is Parquet or Feather."""
    return raw.startswith((_PARQUET, b"ARROW1"))


def _read_columnar(path: Path, options: ReadOptions) -> Table:
    """Read the columns that are needed of Parquet or Feather; others are not decoded.

    Raises:
        ContentError: a column is missing, or there are too many rows.
    """
    scanned = dataset.ParquetFragmentScanOptions(page_checksum_verification=True)
    parquet = dataset.ParquetFileFormat(default_fragment_scan_options=scanned)
    file = dataset.dataset(path, format=parquet if Head.of(path).raw.startswith(_PARQUET) else "feather")
    columns = find_columns(file.schema.names, options)
    check_size(file.count_rows())
    rows = None
    with suppress(MemoryError):  # of a size in a damaged file, which no machine has
        rows = file.to_table(columns=list(set(columns.titles.values())), use_threads=False)
    if rows is None:
        raise ContentError("it is damaged: it declares more values than fit into memory")
    rows.validate(full=True)
    rows = pa.table({name: rows[title] for name, title in columns.titles.items()})
    return Table(rows, columns.unit, clock_s=columns.clock_s)


def from_frame(frame: pd.DataFrame, options: ReadOptions) -> tuple[Table, pd.Index]:
    """Take the columns of a data frame; levels of its index that have names count as columns.

    Returns:
        The table, with ids 0, 1, 2 ..., and the ids in the data frame.

    Raises:
        ContentError: a column is missing, or holds something else.
    """
    levels = [name for name in frame.index.names if name is not None and name not in frame]
    frame = frame.reset_index(level=levels) if levels else frame
    titles = list(map(str, frame.columns))
    columns = find_columns(titles, options)
    arrays: dict[str, pa.ChunkedArray] = {}
    for name, title in columns.titles.items():
        values = frame.iloc[:, titles.index(title)]
        if name == "id":
            number, people = pd.factorize(values)
            array = pa.array(number, mask=number < 0)
        elif values.dtype == object:
            array = pa.array(values.map(str, na_action="ignore"), pa.string(), from_pandas=True)
        else:
            array = pa.array(values, from_pandas=True)
        arrays[name] = pa.chunked_array([array])
    return Table(pa.table(arrays), columns.unit, clock_s=columns.clock_s), people
