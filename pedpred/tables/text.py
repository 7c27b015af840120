"""Numbers in text files: bounded, exact, with errors that say in which line."""

from __future__ import annotations

import logging
import math
import re
from array import array
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError, brief, worded
from pedpred.files import translate_errors
from pedpred.storage.tracks import MOST_NUMBERS
from pedpred.tables.encodings import decoded_lines

Row = tuple[int, Sequence[str]]
"""Line number (from 1) and fields of a line."""

OWN_FILE = "Correct the line, or remove it"
"""What to do about a wrong line in a file of one's own."""
OWN_VALUES = "Correct these values, or remove their lines"
"""What to do about values that may be in several lines of it."""
AS_TIMES = "Write times as seconds, or as 2024-03-05 14:02:07.5, all in the same form"
"""What to do about a time that is neither."""

_FETCHED = "Correct the file or fetch it again"
PLAIN_NUMBERS = "Write all numbers with decimal points and without thousands separators"
_GROUPED = re.compile(r"[+-]?\d{1,3}([,.'\u2019 \u00a0\u202f]\d{3})+([.,]\d*)?")
_CLOCK = re.compile(r"\d:\d")
_WHOLE = ("id", "track_id", "frame", "group_id", "person_id")
_EXACT = 2**53  # floats of larger whole numbers are rounded
_BLOCK_ROWS = 2**14
_log = logging.getLogger(__name__)


def text_lines(path: Path, remedy: str = _FETCHED) -> Iterator[tuple[int, str]]:
    """Line number (from 1) and content of each line that is not blank.

    Args:
        path: the file.
        remedy: what to do if it is not text.

    Raises:
        SourceError: the file is missing, or no text.
    """
    if not path.exists():
        raise SourceError(path, None, "the file is missing")
    with translate_errors(
        lambda problem: SourceError(path, None, f"not a readable text file ({problem})", remedy)
    ):
        yield from decoded_lines(path)


def text_rows(path: Path) -> Iterator[Row]:
    """Line number and blank-separated fields of each line that has any; errors of `text_lines`."""
    return ((line, content.split()) for line, content in text_lines(path))


def is_number(field: str) -> bool:
    """Whether a field is a finite number, without the underscores that Python allows."""
    try:
        return "_" not in field and bool(np.isfinite(float(field)))
    except ValueError:
        return False


def number(path: Path, line: int, column: str, field: str, remedy: str = _FETCHED) -> float:
    """The finite number in a field.

    Raises:
        SourceError: it is something else.
    """
    try:
        value = float(_plain(field))
    except ValueError as cause:
        what = (
            AS_TIMES
            if _CLOCK.search(field)
            else PLAIN_NUMBERS
            if _GROUPED.fullmatch(field.strip())
            else remedy
        )
        raise SourceError(path, line, f"{column} = {brief(field.strip())} is not a number", what) from cause
    if not math.isfinite(value):
        raise SourceError(path, line, f"{column} = {brief(field.strip())}, but it must be finite", remedy)
    return value


def whole_number(path: Path, line: int, column: str, field: str, remedy: str = _FETCHED) -> int:
    """The whole number of 64 bits in a field, exactly.

    Raises:
        SourceError: it is something else, or written as a fraction too large to be exact.
    """
    try:
        value = int(_plain(field))
    except ValueError:
        fraction = number(path, line, column, field, remedy)
        if not fraction.is_integer() or abs(fraction) > _EXACT:
            problem = f"{column} = {fraction!r}, but it must be a whole number"
            raise SourceError(path, line, problem, remedy) from None
        value = int(fraction)
    if not -(2**63) <= value < 2**63:
        problem = f"{column} = {value}, but it must be a whole number of 64 bits"
        raise SourceError(path, line, problem, remedy)
    return value


def _plain(field: str) -> str:
    """The text of a number, without the underscores that Python allows between digits.

    Raises:
        ValueError: it has some.
    """
    if "_" in field:
        raise ValueError(f"{brief(field)} has an underscore")
    return field


def check_width(
    path: Path, line: int, fields: Sequence[str], columns: Sequence[str], remedy: str = _FETCHED
) -> None:
    """Check that a line has a field for each column.

    Raises:
        SourceError: it does not.
    """
    if len(fields) != len(columns):
        problem = f"{len(fields)} columns, expected {len(columns)}: {' '.join(columns)}"
        raise SourceError(path, line, problem, remedy)


def checked_rows(path: Path, rows: Iterable[Row], columns: Sequence[str]) -> Iterator[Row]:
    """The rows, which have a field for each column; errors of `check_width`."""
    for line, fields in rows:
        check_width(path, line, fields, columns)
        yield line, fields


def numbers(path: Path, line: int, fields: Sequence[str], columns: Sequence[str]) -> list[float]:
    """The finite numbers of one line, one for each named column; errors of `number` and `check_width`."""
    check_width(path, line, fields, columns)
    return [number(path, line, column, field) for column, field in zip(columns, fields, strict=True)]


def read_numbers(
    path: Path,
    rows: Iterable[Row],
    titles: Sequence[str],
    wanted: Mapping[str, str],
    remedy: str = _FETCHED,
    optional: Collection[str] = (),
) -> dict[str, np.ndarray]:
    """Read some columns of a table.

    Args:
        path: the file, for errors.
        rows: its lines.
        titles: of all columns, as the file has them.
        wanted: title -> name of the columns to read; names of ids and frames hold whole numbers.
        remedy: what to do about a wrong line.
        optional: names of columns that are left out, with a warning, where they hold something else.

    Returns:
        Name -> column, [M] int64 or float64, and `line`.

    Raises:
        SourceError: there are too many rows, or one has another number of columns or something else than a
            number; it names the line.
    """
    names = ("line", *wanted.values())
    columns = {name: array("q" if name in (*_WHOLE, "line") else "d") for name in names}
    rows, most_rows, count = iter(rows), MOST_NUMBERS // len(columns), 0
    while block := list(islice(rows, _BLOCK_ROWS)):
        count += len(block)
        if count > most_rows:
            raise SourceError(
                path, block[-1][0], f"more than {most_rows} rows", f"Divide the {worded('file', 'table')}"
            )
        for line, fields in block:
            check_width(path, line, fields, titles, remedy)
        lines = [line for line, _ in block]
        columns["line"].extend(lines)
        for title, column in zip(titles, zip(*(fields for _, fields in block), strict=True), strict=True):
            name = wanted.get(title)
            if name is None or name not in columns:
                continue
            try:
                values = _parsed(path, lines, title, column, name in _WHOLE, remedy)
            except SourceError as problem:
                if name not in optional:
                    raise
                _log.warning("%s. Column %s is not used", str(problem).removesuffix(f". {remedy}"), title)
                del columns[name]
            else:
                columns[name].frombytes(values.tobytes())
    return {name: np.frombuffer(column, column.typecode) for name, column in columns.items()}


def _parsed(
    path: Path, lines: list[int], title: str, column: Sequence[str], whole: bool, remedy: str
) -> np.ndarray:
    """Convert a column at once, or field by field where that fails, to name the line."""
    convert: Callable[[str], float] = int if whole else float
    try:
        _plain("".join(column))
        values = np.fromiter(map(convert, column), np.int64 if whole else np.float64, len(column))
        if whole or np.isfinite(values).all():
            return values
    except (ValueError, OverflowError):
        pass
    slow = partial(whole_number if whole else number, path, remedy=remedy)
    return np.array([slow(line, title, field) for line, field in zip(lines, column, strict=True)])


def check_unique(path: Path, columns: Mapping[str, np.ndarray], first: str, second: str) -> None:
    """Check that no two rows of `read_numbers` have the same pair of values.

    Args:
        path: the file, for errors.
        columns: of `read_numbers`.
        first: name of the first column of the pair.
        second: of the second.

    Raises:
        SourceError: two have; it names both lines.
    """
    one, other = columns[first], columns[second]
    order = np.lexsort((other, one))  # stable: of equal rows the earlier line comes first
    again = np.flatnonzero((np.diff(one[order]) == 0) & (np.diff(other[order]) == 0))
    if len(again):
        row = int(again[np.argmin(columns["line"][order[again + 1]])])
        here, earlier = order[row + 1], order[row]
        repeated = f"{first} {one[here]} and {second} {other[here]} again"
        raise SourceError(
            path, int(columns["line"][here]), f"{repeated}, first in line {columns['line'][earlier]}"
        )
