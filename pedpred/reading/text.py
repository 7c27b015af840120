"""Columns of text files: read in blocks, bounded, with errors that name the line."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TextIO

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import csv

from pedpred.errors import brief
from pedpred.reading.errors import CORRECT, ContentError, row_error
from pedpred.reading.head import UTF_16
from pedpred.storage.tracks import MOST_NUMBERS

BLANKS = " "
"""The delimiter that stands for any number of blanks and tabs."""
MISSING = ("", "?", "-", "nan", "na", "n/a", "<na>", "nat", "null", "none")
"""Spellings of a missing value, in small letters."""
_BLOCK, _LONGEST_LINE = 2**21, 2**20
_EXACT = 2**53  # floats of larger whole numbers are rounded


@dataclass(frozen=True)
class TextForm:
    """How a text is divided into columns.

    Attributes:
        titles: of its columns, in order.
        delimiter: one character; `BLANKS`: any number of blanks or tabs.
        skipped: lines before the first row.
        encoding: as Python calls it; None: UTF-8, or UTF-16 with a mark.
        decimal: the decimal mark.
    """

    titles: Sequence[str]
    delimiter: str = ","
    skipped: int = 0
    encoding: str | None = None
    decimal: str = "."


def check_size(rows: int, columns: int = 4) -> None:
    """Check that a table is not too large.

    Raises:
        ContentError: it has more than `MOST_NUMBERS` values.
    """
    if rows > (most := MOST_NUMBERS // max(4, columns)):
        raise ContentError(f"more than {most} rows", "Divide the file")


def read_lines(path: Path, encoding: str | None = None) -> Iterator[str]:
    """Yield the lines of a text without their ends.

    Raises:
        ContentError: the file is not text in this encoding, or a line is absurdly long.
    """
    with _open_text(path, encoding) as file:
        while line := _next_line(file):
            yield line.rstrip("\n")


def first_lines(path: Path, count: int, encoding: str | None = None) -> list[str]:
    """The first lines of a text."""
    return list(islice(read_lines(path, encoding), count))


@contextmanager
def _open_text(path: Path, encoding: str | None) -> Iterator[TextIO]:
    if encoding is None:
        with path.open("rb") as raw:
            encoding = "utf-16" if raw.read(2) in UTF_16 else "utf-8-sig"
    try:
        with path.open(encoding=encoding) as file:
            yield file
    except UnicodeError as cause:
        remedy = "Give the encoding, such as --encoding cp1252, or save the file as UTF-8"
        raise ContentError(f"the text is not {encoding} ({cause})"[:300], remedy) from cause


def _next_line(file: TextIO) -> str:
    line = file.readline(_LONGEST_LINE)
    if len(line) == _LONGEST_LINE:
        raise ContentError(f"a line of more than {_LONGEST_LINE} characters")
    return line


def read_columns(
    path: Path, form: TextForm, wanted: Mapping[str, str], words: Collection[str] = ("id", "class")
) -> pa.Table:
    """Read some columns.

    Args:
        path: the file.
        form: how it is divided.
        wanted: name of a column of the result -> its title.
        words: names of columns that are kept as text; in `time`, dates become seconds.

    Returns:
        The columns: dictionaries of text, or float64 (NaN: missing).

    Raises:
        ContentError: a line has another number of columns, a value is no number, or there are too many lines.
    """
    at = {name: list(form.titles).index(title) for name, title in wanted.items()}
    parts: dict[str, list[pa.Array]] = {name: [] for name in at}
    count = 0
    for block in _blocks(path, form):
        before = form.skipped + count
        rows = _parse(block, form, sorted(set(at.values())), before)
        for name, number in at.items():
            column = pc.utf8_trim_whitespace(rows[str(number)].combine_chunks())
            if name in words:
                parts[name].append(column.dictionary_encode())
            else:
                convert = seconds if name == "time" else numbers
                parts[name].append(pa.array(convert(column, wanted[name], before, form.decimal)))
        count += rows.num_rows
        check_size(count, len(at))
    kinds = {name: pa.string() if name in words else pa.float64() for name in at}
    columns = {n: pa.chunked_array(part) if part else pa.array([], kinds[n]) for n, part in parts.items()}
    pa.default_memory_pool().release_unused()
    return pa.table(columns).unify_dictionaries()


def _blocks(path: Path, form: TextForm) -> Iterator[bytes]:
    """Yield the rows, whole lines as UTF-8; runs of blanks become one where they are the delimiter."""
    with _open_text(path, form.encoding) as file:
        for _ in range(form.skipped):
            _next_line(file)
        while text := file.read(_BLOCK):
            text += _next_line(file)
            if form.delimiter == BLANKS:
                text = re.sub(r" ?\n ?", "\n", re.sub(r"[ \t]+", " ", text)).strip(" ")
            if text.strip():
                yield text.encode()


def _parse(block: bytes, form: TextForm, used: Sequence[int], before: int) -> pa.Table:
    """Divide lines into columns of text, which are called by their numbers.

    Raises:
        ContentError: a line has another number of columns.
    """
    wrong: list[csv.InvalidRow] = []

    def refuse(row: csv.InvalidRow) -> str:
        wrong.append(row)
        return "error"

    included = [str(number) for number in used]
    names = [str(number) for number in range(len(form.titles))]
    try:
        return csv.read_csv(
            pa.BufferReader(block),
            csv.ReadOptions(column_names=names, use_threads=False, block_size=2 * len(block) + 1),
            csv.ParseOptions(delimiter=form.delimiter, invalid_row_handler=refuse),
            csv.ConvertOptions(
                include_columns=included,
                column_types=dict.fromkeys(included, pa.string()),
                strings_can_be_null=False,
            ),
        )
    except pa.ArrowInvalid as cause:
        if not wrong:
            raise ContentError(str(cause)[:300]) from cause
        listed = " ".join(form.titles)[:200]
        problem = f"{wrong[0].actual_columns} columns, expected {wrong[0].expected_columns}: {listed}"
        line = None if wrong[0].number is None else before + wrong[0].number
        raise ContentError(problem, "Correct the line, or remove it", line) from cause


def numbers(
    column: pa.Array | pa.ChunkedArray, title: str, before: int | None = None, decimal: str = "."
) -> np.ndarray:
    """Convert a column to numbers.

    Args:
        column: text or numbers.
        title: of the column, for errors.
        before: lines before the first row; None: rows are counted.
        decimal: the decimal mark of a text.

    Returns:
        [M] float64; NaN where a value is missing.

    Raises:
        ContentError: something is neither a finite number nor missing; it names line and value.
    """
    if pa.types.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
        return _numbers_in_texts(column, title, before, decimal)
    try:
        values = np.asarray(column.cast(pa.float64()).to_numpy(), np.float64)
    except pa.ArrowException as cause:
        raise ContentError(f"column {title} holds {column.type}, not numbers") from cause
    _refuse(np.isinf(values), values, title, "must be finite", before)
    return values


def _numbers_in_texts(
    column: pa.Array | pa.ChunkedArray, title: str, before: int | None, decimal: str
) -> np.ndarray:
    texts = pc.replace_substring(column, ",", ".") if decimal == "," else column
    try:
        values = pc.cast(texts, pa.float64()).to_numpy()
        if np.isfinite(values).all():
            return np.asarray(values, np.float64)
    except pa.ArrowInvalid:
        pass  # the missing ones, and the wrong one, are found below
    values = np.full(len(texts), np.nan)
    for row, text in enumerate(texts.to_pylist()):
        if text is None or text.strip().lower() in MISSING:
            continue
        try:
            values[row] = finite_number(text)
        except ValueError as cause:
            comma = re.fullmatch(r"[+-]?\d+,\d+", text.strip())
            remedy = "Give the decimal mark: --decimal ," if comma else "Correct the line, or remove it"
            raise row_error(row, before, f"{title} = {brief(text)} is not a finite number", remedy) from cause
    return values


def finite_number(text: str) -> float:
    """Convert a text to a finite number; Python's `1_000` is none.

    Raises:
        ValueError: it is not one.
    """
    if "_" in text or not np.isfinite(number := float(text)):
        raise ValueError(f"{text!r} is not a finite number")
    return number


def seconds(
    column: pa.Array | pa.ChunkedArray, title: str, before: int | None = None, decimal: str = "."
) -> np.ndarray:
    """Convert a column of times to numbers: dates of ISO 8601 to Unix time; else as `numbers`."""
    if pa.types.is_timestamp(column.type):
        dates = pd.Series(column.to_pandas())
    else:
        try:
            return numbers(column, title, before, decimal)
        except ContentError as cause:
            try:
                dates = pd.to_datetime(pd.Series(column.to_pylist(), dtype=str), format="ISO8601", utc=True)
            except ValueError:
                remedy = "Write times as seconds, or as 2024-03-05T14:02:07.5 (ISO 8601)"
                raise ContentError(cause.problem, remedy, cause.line) from cause
    naive = dates.dt.tz_convert(None) if dates.dt.tz is not None else dates
    since = (naive - pd.Timestamp(0)).to_numpy().astype("timedelta64[ns]")
    return np.where(np.isnat(since), np.nan, since.astype(np.int64) / 1e9)


def whole_numbers(values: np.ndarray, title: str, before: int | None = None) -> np.ndarray:
    """Check that numbers are whole, and return them as such. [M] int64.

    Raises:
        ContentError: one is missing, has a fraction, or is too large to be exact.
    """
    whole = (np.abs(values) <= _EXACT) & (values == np.rint(values))
    _refuse(~whole, values, title, "must be a whole number", before)
    return values.astype(np.int64)


def finite_numbers(values: np.ndarray, title: str, before: int | None = None) -> np.ndarray:
    """Check that no number is missing, and return them.

    Raises:
        ContentError: one is.
    """
    _refuse(~np.isfinite(values), values, title, "must be finite", before)
    return values


def _refuse(wrong: np.ndarray, values: np.ndarray, title: str, rule: str, before: int | None) -> None:
    """Refuse the first of the values that are wrong. [M] bool."""
    for row in np.flatnonzero(wrong)[:1]:
        value = values[row].item()
        problem = f"{title} is missing" if value != value else f"{title} = {brief(value)}, {rule}"
        raise row_error(row, before, problem, CORRECT)
