"""Columns of text files: streamed through PyArrow, bounded, with errors that name the line."""

from __future__ import annotations

import codecs
import io
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import csv

from pedpred.errors import brief
from pedpred.reading.errors import CORRECT, ContentError
from pedpred.reading.head import UTF_16
from pedpred.storage.tracks import MOST_NUMBERS

BLANKS = " "
"""The delimiter that stands for any number of blanks and tabs."""
MISSING = ("", "?", "-", "nan", "na", "n/a", "<na>", "nat", "null", "none")
"""Spellings of a missing value, in small letters."""
_CHUNK, _LONGEST_LINE = 2**20, 2**20
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


def read_lines(path: Path, encoding: str | None = None) -> Iterator[str]:
    """Yield the lines of a text without their ends.

    Raises:
        ContentError: the file is not text in this encoding, or a line is absurdly long.
    """
    rest = ""
    for text in _chunks(path, encoding):
        lines = re.split(r"\r\n|\r|\n", rest + text)
        rest = lines.pop()
        yield from lines
        if len(rest) > _LONGEST_LINE:
            raise ContentError(f"a line of more than {_LONGEST_LINE} characters")
    if rest:
        yield rest


def _chunks(path: Path, encoding: str | None) -> Iterator[str]:
    """Decode a file piece by piece; no piece ends between the two characters of a line end."""
    with path.open("rb") as file:
        raw = file.read(_CHUNK)
        name = encoding or ("utf-16" if raw.startswith(UTF_16) else "utf-8-sig")
        decoder = codecs.getincrementaldecoder(name)()
        held = ""
        while raw:
            following = file.read(_CHUNK)
            try:
                text = held + decoder.decode(raw, final=not following)
            except UnicodeError as cause:
                remedy = "Give the encoding, such as --encoding cp1252, or save the file as UTF-8"
                raise ContentError(f"the text is not {name} ({cause})"[:300], remedy) from cause
            held = "\r" if text.endswith("\r") and following else ""
            yield text[: len(text) - len(held)]
            raw = following


class _Stream(io.RawIOBase):
    """The rows of a text as UTF-8, without the lines before them; runs of blanks become one."""

    def __init__(self, path: Path, form: TextForm):
        self._chunks = _chunks(path, form.encoding)
        self._skipped, self._blanks = form.skipped, form.delimiter == BLANKS
        self._rest, self._ready = "", b""

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: object) -> int:
        while not self._ready:
            text = next(self._chunks, None)
            if text is None:
                self._ready, self._rest = self._rows(self._rest + "\n") if self._rest.strip() else b"", ""
                break
            end = max((self._rest + text).rfind("\n"), (self._rest + text).rfind("\r")) + 1
            whole, self._rest = (self._rest + text)[:end], (self._rest + text)[end:]
            if len(self._rest) > _LONGEST_LINE:
                raise ContentError(f"a line of more than {_LONGEST_LINE} characters")
            self._ready = self._rows(whole)
        view = memoryview(buffer)  # type: ignore[arg-type]
        count = min(len(view), len(self._ready))
        view[:count] = self._ready[:count]
        self._ready = self._ready[count:]
        return count

    def _rows(self, text: str) -> bytes:
        while self._skipped and text:
            text = re.sub(r"\A[^\r\n]*(\r\n|\r|\n)?", "", text, count=1)
            self._skipped -= 1
        if self._blanks:
            text = re.sub(r"[ \t]*[\r\n]+[ \t]*", "\n", re.sub(r"[ \t]+", " ", text)).lstrip()
        return text.encode()


def read_columns(
    path: Path, form: TextForm, wanted: Mapping[str, str], words: Collection[str] = ("id", "class")
) -> pa.Table:
    """Read some columns.

    Args:
        path: the file.
        form: how it is divided.
        wanted: name of a column of the result -> its title.
        words: names of columns that are kept as text; of others, only `time` may be text, as dates are.

    Returns:
        The columns: dictionaries of text, float64 (NaN: missing), or text.

    Raises:
        ContentError: a line has another number of columns, a value is no number, or there are too many lines.
    """
    names = [str(number) for number in range(len(form.titles))]
    at = {name: names[list(form.titles).index(title)] for name, title in wanted.items()}
    most, count = MOST_NUMBERS // max(4, len(at)), 0
    parts: dict[str, list[pa.Array]] = {name: [] for name in at}
    for batch in _batches(path, form, names, sorted(set(at.values()), key=int)):
        for name, number in at.items():
            column = pc.utf8_trim_whitespace(batch[number])
            if name in words:
                parts[name].append(column.dictionary_encode())
            elif name == "time" and _is_text(column, parts[name], form.decimal):
                parts[name].append(column)
            else:
                values = numbers(column, wanted[name], form.skipped + count, form.decimal)
                parts[name].append(pa.array(values))
        if (count := count + len(batch)) > most:
            raise ContentError(f"more than {most} rows", "Divide the file")
    kinds = {name: pa.string() if name in words else pa.float64() for name in at}
    columns = {n: pa.chunked_array(part) if part else pa.array([], kinds[n]) for n, part in parts.items()}
    pa.default_memory_pool().release_unused()
    return pa.table(columns).unify_dictionaries()


def _is_text(column: pa.Array, before: Sequence[pa.Array], decimal: str) -> bool:
    """Whether a column of times holds dates: its first value is no number."""
    if before:
        return pa.types.is_string(before[0].type)
    try:
        float(column[0].as_py().replace(decimal, ".")) if len(column) else 0.0
    except ValueError:
        return column[0].as_py().lower() not in MISSING
    return False


def _batches(
    path: Path, form: TextForm, names: Sequence[str], used: Sequence[str]
) -> Iterator[pa.RecordBatch]:
    """Stream some columns as text.

    Raises:
        ContentError: a line has another number of columns.
    """
    wrong: list[csv.InvalidRow] = []

    def refuse(row: csv.InvalidRow) -> str:
        wrong.append(row)
        return "error"

    try:
        yield from csv.open_csv(
            io.BufferedReader(_Stream(path, form), _CHUNK),
            csv.ReadOptions(column_names=names, use_threads=False, block_size=2 * _LONGEST_LINE),
            csv.ParseOptions(delimiter=form.delimiter, invalid_row_handler=refuse),
            csv.ConvertOptions(
                include_columns=used, column_types=dict.fromkeys(used, pa.string()), strings_can_be_null=False
            ),
        )
    except pa.ArrowInvalid as cause:
        if wrong:
            row = wrong[0]
            listed = " ".join(form.titles)[:200]
            problem = f"{row.actual_columns} columns, expected {row.expected_columns}: {listed}"
            line = None if row.number is None else form.skipped + row.number
            raise ContentError(problem, "Correct the line, or remove it", line) from cause
        if "Empty CSV file" not in str(cause):
            raise ContentError(str(cause)[:300]) from cause


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
    if not pa.types.is_string(column.type) and not pa.types.is_large_string(column.type):
        try:
            values = np.asarray(column.cast(pa.float64()).to_numpy(), np.float64)
        except pa.ArrowException as cause:
            raise ContentError(f"column {title} holds {column.type}, not numbers") from cause
        if len(infinite := np.flatnonzero(np.isinf(values))):
            raise _wrong(title, values[infinite[0]].item(), "is not finite", int(infinite[0]), before)
        return values
    texts = pc.replace_substring(column, ",", ".") if decimal == "," else column
    try:
        values = pc.cast(texts, pa.float64()).to_numpy()
        if np.isfinite(values).all():
            return np.asarray(values, np.float64)
    except pa.ArrowInvalid:
        pass
    return np.fromiter(_each_number(texts.to_pylist(), title, before), np.float64, len(texts))


def to_number(text: str) -> float:
    """Convert a text to a number; Python's `1_000` is none.

    Raises:
        ValueError: it is not a number.
    """
    if "_" in text:
        raise ValueError(f"{text!r} is not a number")
    return float(text)


def _each_number(texts: Sequence[str | None], title: str, before: int | None) -> Iterator[float]:
    """Convert texts one by one, to find the wrong one."""
    for row, text in enumerate(texts):
        if text is None or text.strip().lower() in MISSING:
            yield np.nan
            continue
        try:
            value = to_number(text)
        except ValueError as cause:
            comma = re.fullmatch(r"[+-]?\d+,\d+", text.strip())
            remedy = "Give the decimal mark: --decimal ," if comma else "Correct the line, or remove it"
            raise _wrong(title, text, "is not a number", row, before, remedy) from cause
        if not np.isfinite(value):
            raise _wrong(title, text, "must be finite", row, before)
        yield value


def finite_numbers(column: pa.ChunkedArray, title: str) -> np.ndarray:
    """Convert a column where no value may be missing, of a text that begins with its rows."""
    values = numbers(column, title, 0)
    for row in np.flatnonzero(np.isnan(values))[:1]:
        raise _wrong(title, column[int(row)].as_py(), "must be finite", int(row), 0)
    return values


def whole_numbers(values: np.ndarray, title: str, before: int | None = None) -> np.ndarray:
    """Check that numbers are whole, and return them as such. [M] int64.

    Raises:
        ContentError: one is missing, has a fraction, or is too large to be exact.
    """
    wrong = np.flatnonzero(~((values == np.rint(values)) & (np.abs(values) <= _EXACT)))
    if len(wrong):
        value = values[wrong[0]].item()
        rule = "is missing" if np.isnan(value) else "must be a whole number"
        raise _wrong(title, value, rule, int(wrong[0]), before)
    return values.astype(np.int64)


def _wrong(
    title: str, value: object, rule: str, row: int, before: int | None, remedy: str = CORRECT
) -> ContentError:
    shown = "" if rule == "is missing" else f" = {brief(value)}"
    joint = "," if rule.startswith("must") and shown else ""
    if before is None:
        return ContentError(f"row {row + 1}: {title}{shown}{joint} {rule}", remedy)
    return ContentError(f"{title}{shown}{joint} {rule}", remedy, before + row + 1)


def first_lines(path: Path, count: int, encoding: str | None = None) -> list[str]:
    """The first lines of a text."""
    return list(islice(read_lines(path, encoding), count))
