"""Decimal commas, as in `1,5`, where commas do not separate columns."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from pedpred.errors import SourceError
from pedpred.tables.text import PLAIN_NUMBERS, Row

_COMMA = re.compile(r"\s*[+-]?\d+,\d+(?:[eE][+-]?\d+)?\s*")
_THOUSANDS = re.compile(r"\s*[+-]?[1-9]\d{0,2},\d{3}\s*")


def has_decimal_comma(field: str) -> bool:
    """Whether a field is a number with a decimal comma."""
    return bool(_COMMA.fullmatch(field))


def with_decimal_points(
    path: Path, rows: Iterable[Row], used: Sequence[int], separator: str | None
) -> Iterator[Row]:
    """Write decimal commas in the used columns as points.

    Args:
        path: the file, for errors.
        rows: its lines.
        used: columns of numbers.
        separator: of fields.

    Raises:
        SourceError: commas may also separate thousands: numbers have points too, or, where commas separate
            fields, all have three digits behind a comma.
    """
    comma = point = doubtful = None
    decimal = separator != ","
    for line, fields in rows:
        for at in used:
            if "." in fields[at] and ":" not in fields[at]:  # dates have points, too
                point = line
            if has_decimal_comma(fields[at]):
                comma = line
                decimal = decimal or not _THOUSANDS.fullmatch(fields[at])
                doubtful = doubtful or (line, fields[at].strip())
                fields = [*fields[:at], fields[at].replace(",", "."), *fields[at + 1 :]]
        if comma and point:
            problem = f"numbers have commas in line {comma} and points in line {point}"
            raise SourceError(path, line, problem, PLAIN_NUMBERS)
        yield line, fields
    if doubtful and not decimal:
        problem = f"the comma in {doubtful[1]} may be a decimal one, or separate thousands"
        raise SourceError(path, doubtful[0], problem, PLAIN_NUMBERS)
