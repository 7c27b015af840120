"""Ids as they are written: people whose ids differ in any letter are different people."""

from __future__ import annotations

import logging
from array import array
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError
from pedpred.tables.missing import MISSING
from pedpred.tables.text import OWN_FILE, Row, is_number, whole_number
from pedpred.tables.titles import naming

_OTHERS = "If another column holds them, name all in order:"
_LONGEST_NAME, _MOST_NAMES = 200, 500_000
_FEW_FRACTIONS = 0.25  # more are not errors
_LONGEST_PLAIN = 18  # digits that fit into 64 bits
_NOBODY = MISSING - {"-", ".", "na", "nat", "nil"}  # these may be names
_NO_ID = "{} = {!r}, but everybody needs an id"
_log = logging.getLogger(__name__)


@dataclass
class Ids:
    """The ids in a column.

    Rows up to the first id that is not written as a plain whole number keep their ids; in later rows, ids are
    replaced by their places among the later ones, until all rows are read.

    Attributes:
        path: the file, for errors.
        title: of the column.
        remedy: what to do where a number is none of an id.
        plain_rows: number of rows that keep their ids.
        later: id -> its place among the ids of later rows.
        first_lines: of each of them.
    """

    path: Path
    title: str
    remedy: str = field(default_factory=lambda: f"Ids are whole numbers or words. {_OTHERS} {naming()}")
    plain_rows: int = 0
    later: dict[str, int] = field(default_factory=dict)
    first_lines: array[int] = field(default_factory=lambda: array("q"))

    def numbered(self, rows: Iterable[Row], at: int, places: Sequence[int] = ()) -> Iterator[Row]:
        """Let column `at` hold whole numbers alone.

        Args:
            rows: the lines.
            at: the column of ids.
            places: columns of x and y; rows that have these and no id are about nobody who was tracked, and
                left out, unless all are so.

        Raises:
            SourceError: an id is empty or too long, or there are too many; it names the line.
        """
        nobody: list[int] = []
        for line, fields in rows:
            name = fields[at].strip()
            if name.lower() in _NOBODY and places and all(is_number(fields[k]) for k in places):
                nobody = nobody or [line, 0]
                nobody[1] += 1
            elif not self.later and is_plain(name):
                self.plain_rows += 1
                yield line, fields
            else:
                place = self.later.get(name)
                if place is None:
                    place = self._added(line, name)
                yield line, [*fields[:at], str(place), *fields[at + 1 :]]
        if nobody and not self.plain_rows and not self.later:
            raise SourceError(self.path, nobody[0], _NO_ID.format(self.title, ""), OWN_FILE)
        if nobody:
            text = "%s: rows without an id are about nobody who was tracked, and left out: %s"
            _log.warning(text, self.path, f"{nobody[1]}, the first in line {nobody[0]}")

    def _added(self, line: int, name: str) -> int:
        problem = None
        if name.lower() in _NOBODY:
            problem = _NO_ID.format(self.title, name)
        elif len(name) > _LONGEST_NAME:
            problem = f"{self.title} has {len(name)} characters, expected at most {_LONGEST_NAME}"
        if problem:
            raise SourceError(self.path, line, problem, OWN_FILE)
        if len(self.later) >= _MOST_NAMES:
            raise SourceError(self.path, line, f"more than {_MOST_NAMES} different {self.title}", self.remedy)
        self.first_lines.append(line)
        return self.later.setdefault(name, len(self.later))

    def holds_fractions(self) -> bool:
        """Whether all ids are numbers and many distinct ones have fractions, as times do."""
        numbers = [float(name) for name in self.later if is_number(name)]
        fractions = sum(not value.is_integer() for value in numbers)
        return len(numbers) == len(self.later) and fractions > _FEW_FRACTIONS * len(numbers)

    def written(self, column: np.ndarray) -> np.ndarray:
        """Return the ids as numbers.

        Args:
            column: what was read from the rows of `numbered`. [M] int64

        Returns:
            [M] float64.
        """
        later = np.array([float(name) for name in self.later])
        return np.concatenate(
            [column[: self.plain_rows].astype(np.float64), later[column[self.plain_rows :]]]
        )

    def whole(self, column: np.ndarray) -> np.ndarray | None:
        """The whole numbers that the ids write; None: some are words, or have more than 64 bits.

        Args:
            column: what was read from the rows of `numbered`. [M] int64

        Returns:
            [M] int64.

        Raises:
            SourceError: all are numbers, and one is a fraction; it names the line.
        """
        if not all(is_number(name) and not _is_huge(name) for name in self.later):
            return None
        written = zip(self.later, self.first_lines, strict=True)
        values = (whole_number(self.path, line, self.title, name, self.remedy) for name, line in written)
        later = np.fromiter(values, np.int64, len(self.later))
        return np.concatenate([column[: self.plain_rows], later[column[self.plain_rows :]]])

    def of_tracks(self, column: np.ndarray) -> tuple[np.ndarray, list[str]]:
        """Ids as numbers: those that they write, or their places in the order of appearance.

        The latter where some are words, or where two of them are the same number, such as 1 and 01.

        Args:
            column: see `whole`.

        Returns:
            [M] int64, and the ids in the order of their places; none where the numbers are the ids.

        Raises:
            SourceError: see `whole`.
        """
        values = self.whole(column)
        if values is not None and not self.later:
            return values, []
        names, places = self._named(column)
        if values is not None:
            number = np.zeros(len(names), np.int64)
            number[places] = values
            _, group, sizes = np.unique(number, return_inverse=True, return_counts=True)
            if sizes.max(initial=1) == 1:
                return values, []
            one, other = (names[k] for k in np.flatnonzero(group == sizes.argmax())[:2])
            problem = f"{self.title} {one} and {other} are the same number, but written differently"
            _log.warning("%s: %s: they are read as different people", self.path, problem)
        return places, names

    def _named(self, column: np.ndarray) -> tuple[list[str], np.ndarray]:
        """All ids in the order of appearance, and of each row the place of its id."""
        plain, first, inverse = np.unique(column[: self.plain_rows], return_index=True, return_inverse=True)
        order = np.argsort(first)
        places = {str(plain[k]): place for place, k in enumerate(order)}
        early = np.argsort(order)[inverse]
        later = np.array([places.setdefault(name, len(places)) for name in self.later], np.int64)
        return list(places), np.concatenate([early, later[column[self.plain_rows :]]])


def is_plain(name: str) -> bool:
    """Whether a whole number has its usual spelling, which can be restored from its value."""
    digits = name[1:] if name.startswith("-") else name
    usual = digits[:1] != "0" or name == "0"
    return usual and len(digits) <= _LONGEST_PLAIN and digits.isdecimal() and digits.isascii()


def _is_huge(name: str) -> bool:
    """Whether the digits of an id are no number of 64 bits, as those of a UUID."""
    return name.isdecimal() and len(name) > _LONGEST_PLAIN and int(name) >= 2**63
