"""Ids that are words."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from pathlib import Path

from pedpred.tables.text import Row, is_number

_SHOWN_NAMES = 3
_log = logging.getLogger(__name__)


def with_numbered_ids(path: Path, rows: Iterator[Row], at: int, used: Sequence[int]) -> Iterator[Row]:
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
            words = bool(name) and not is_number(name)
        if words and name:
            fields = [*fields[:at], numbers.setdefault(name, str(len(numbers))), *fields[at + 1 :]]
        yield line, fields
    if numbers:
        shown = ", ".join(f"{name} is {number}" for name, number in list(numbers.items())[:_SHOWN_NAMES])
        _log.info(
            "%s: ids are words, and numbered: %s%s", path, shown, ", ..." * (len(numbers) > _SHOWN_NAMES)
        )
