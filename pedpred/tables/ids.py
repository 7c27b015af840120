"""Ids as they are written: people whose ids differ in any letter are different people."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError
from pedpred.tables.text import OWN_FILE, Row, is_number, whole_number

_SHOWN_NAMES = 3
_LONGEST_NAME = 200
_NOBODY = {"", "nan", "null", "none"}
_log = logging.getLogger(__name__)


@dataclass
class Ids:
    """The different ids in a column, in the order of appearance.

    Attributes:
        path: the file, for errors.
        title: of the column.
        remedy: what to do where a number is none of an id.
        first_lines: id -> the line in which it is first.
    """

    path: Path
    title: str
    remedy: str = "Ids are whole numbers or words. If another column holds them, name all in order: --columns"
    first_lines: dict[str, int] = field(default_factory=dict)

    def numbered(self, rows: Iterable[Row], at: int) -> Iterator[Row]:
        """Replace the ids in column `at` by their number in the order of appearance, from 0.

        Raises:
            SourceError: one is empty or too long; it names the line.
        """
        numbers: dict[str, str] = {}
        for line, fields in rows:
            name = fields[at].strip()
            number = numbers.get(name)
            if number is None:
                if len(name) > _LONGEST_NAME:
                    problem = f"{self.title} has {len(name)} characters, expected at most {_LONGEST_NAME}"
                    raise SourceError(self.path, line, problem, OWN_FILE)
                if name.lower() in _NOBODY:
                    problem = f"{self.title} = {name!r}, but everybody needs an id"
                    raise SourceError(self.path, line, problem, OWN_FILE)
                number = numbers[name] = str(len(numbers))
                self.first_lines[name] = line
            yield line, [*fields[:at], number, *fields[at + 1 :]]

    def whole(self) -> np.ndarray | None:
        """The whole numbers that the ids write, [I] int64; None: some are words.

        Raises:
            SourceError: all are numbers, and one is a fraction or too large; it names the line.
        """
        if not all(map(is_number, self.first_lines)):
            return None
        values = [
            whole_number(self.path, line, self.title, name, self.remedy)
            for name, line in self.first_lines.items()
        ]
        return np.array(values, np.int64)

    def of_tracks(self) -> np.ndarray:
        """Ids as numbers: those that they write, or their places in the order of appearance.

        The latter where some are words, or where two of them are the same number, such as 1 and 01.

        Returns:
            [I] int64.

        Raises:
            SourceError: see `whole`.
        """
        names, values = list(self.first_lines), self.whole()
        if values is not None:
            _, again = np.unique(values, return_inverse=True)
            if np.bincount(again, minlength=1).max(initial=0) <= 1:
                return values
            one, other = (names[k] for k in np.flatnonzero(again == np.bincount(again).argmax())[:2])
            problem = f"{self.title} {one} and {other} are the same number, but written differently"
            _log.warning("%s: %s: they are read as different people", self.path, problem)
        shown = ", ".join(f"{name} is {number}" for number, name in enumerate(names[:_SHOWN_NAMES]))
        more = ", ..." * (len(names) > _SHOWN_NAMES)
        _log.info("%s: ids are words, and numbered: %s%s", self.path, shown, more)
        return np.arange(len(names))
