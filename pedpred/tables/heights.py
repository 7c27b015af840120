"""Columns named y that hold heights: where one hardly changes while a later or unused one does."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from pedpred.tables.text import Row
from pedpred.tables.values import number_in

_MUCH, _FAR = 10.0, 0.1
"""People move along the ground's second axis more than their heights change, by the first factor, and by at
least the second share of how far they move along x."""

_STOREY_M, _FEW = 2.0, 0.1
"""Floors are farther apart, and each has more than this share of the detections."""


class Still:
    """Notices a column that hardly changes while another one does, as where the order is x, height, y.

    Args:
        at: the column that must change.
        others: columns that may be meant instead.
        beside: the column of x; None: the others may hold anything, and only a column that never changes
            is noticed.
    """

    def __init__(self, at: int, others: Sequence[int], beside: int | None = None) -> None:
        self._at, self._others, self._beside = at, others, beside
        self._first: Sequence[str] = ()
        self._changed = {at: False} | dict.fromkeys(others, False)
        measured = (at, beside, *others) if others and beside is not None else ()
        self._range = {k: (math.inf, -math.inf) for k in measured}

    def watched(self, rows: Iterable[Row]) -> Iterator[Row]:
        """The rows, while it looks at them."""
        for line, fields in rows:
            if self._others:
                self._first = self._first or [field.strip() for field in fields]
                for k in self._changed:
                    self._changed[k] |= fields[k].strip() != self._first[k]
                for k, (least, most) in self._range.items():
                    value = number_in(fields[k])
                    self._range[k] = min(least, value), max(most, value)
            yield line, fields

    def others_change(self) -> bool:
        """Whether any of the other columns changes."""
        return any(self._changed[k] for k in self._others)

    def moving_column(self) -> tuple[int, str] | None:
        """The column that changes in place of the other one, and how that one does; None: all is well."""
        if not self._changed[self._at]:
            changes = [k for k in self._others if self._changed[k]]
            return (changes[0], f"is {self._first[self._at]} in all lines") if changes else None
        if self._beside is None or not self._range:
            return None
        width = {k: most - least for k, (least, most) in self._range.items()}
        least = max(_MUCH * width[self._at], _FAR * width[self._beside])
        most = width[self._beside] / _FAR  # else x does not change, either, as in degrees beside an altitude
        far = [k for k in self._others if least < width[k] < most]
        return (far[0], f"changes by {width[self._at]:.3g} in all") if far else None


def floors_apart(heights: np.ndarray, unit_m: float) -> tuple[float, float] | None:
    """The heights below and above which people are, with nobody between them; None: there are none.

    Args:
        heights: NaN where there is none. [M]
        unit_m: their unit, m.
    """
    known = np.sort(heights[np.isfinite(heights)])
    inner = known[int(_FEW * len(known)) : math.ceil((1 - _FEW) * len(known))]
    if len(inner) < 2:
        return None
    gap = int(np.argmax(np.diff(inner)))
    low, high = inner[gap], inner[gap + 1]
    return (float(low), float(high)) if (high - low) * unit_m >= _STOREY_M else None
