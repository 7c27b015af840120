"""Numbers in columns that are not read, but say what the others are."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from pedpred.tables.text import Row

_MOST_ROWS = 2**17


class Values:
    """Keeps the numbers in some columns of the first rows.

    Args:
        columns: which ones.
    """

    def __init__(self, columns: Sequence[int]) -> None:
        self.columns = columns
        self._numbers = [array("d") for _ in columns]

    def watched(self, rows: Iterable[Row]) -> Iterator[Row]:
        """The rows, while it looks at them."""
        for count, (line, fields) in enumerate(rows):
            if count < _MOST_ROWS:
                for at, numbers in zip(self.columns, self._numbers, strict=True):
                    numbers.append(number_in(fields[at]))
            yield line, fields

    def array(self) -> np.ndarray:
        """Return the numbers; NaN where a field is none. [K, M]."""
        return np.array([np.frombuffer(numbers) for numbers in self._numbers])


def number_in(field: str) -> float:
    """The number in a field, also with a decimal comma; NaN if there is none."""
    try:
        return float(field.replace(",", "."))
    except ValueError:
        return math.nan
