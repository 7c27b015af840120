"""Blank-separated numbers in text files, with errors that say where."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path

from pedpred.errors import SourceError
from pedpred.files import read_bytes, translate_errors

_LARGEST_WHOLE = 2**53


def text_rows(path: Path, encoding: str = "ascii") -> Iterator[tuple[int, list[str]]]:
    """Line number (from 1) and blank-separated fields of each line that has any."""
    if not path.exists():
        raise SourceError(path, None, "the file is missing")
    with translate_errors(lambda problem: SourceError(path, None, f"not a readable text file ({problem})")):
        text = read_bytes(path).decode(encoding)
    for line, content in enumerate(text.splitlines(), start=1):
        if fields := content.split():
            yield line, fields


def numbers(path: Path, line: int, fields: list[str], columns: tuple[str, ...]) -> list[float]:
    """The finite numbers of one line, one for each named column.

    Raises:
        SourceError: a number is missing, too much, or not one.
    """
    if len(fields) != len(columns):
        problem = f"{len(fields)} columns, expected {len(columns)}: {' '.join(columns)}"
        raise SourceError(path, line, problem)
    values = []
    for column, field in zip(columns, fields, strict=True):
        try:
            value = float(field)
        except ValueError as cause:
            raise SourceError(path, line, f"{column} = {field!r} is not a number") from cause
        if not math.isfinite(value):
            raise SourceError(path, line, f"{column} = {field!r}, but it must be finite")
        values.append(value)
    return values


def whole_number(path: Path, line: int, column: str, values: Mapping[str, float]) -> int:
    """The value of a column that counts something."""
    if not values[column].is_integer() or abs(values[column]) > _LARGEST_WHOLE:
        raise SourceError(path, line, f"{column} = {values[column]!r}, but it must be a whole number")
    return int(values[column])
