"""Columns named y that hold heights: where one never changes while a later or unused one does."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from pedpred.tables.text import Row


class Still:
    """Notices a column that never changes while another one does, as where the order is x, height, y.

    Args:
        at: the column that must change.
        others: columns that may be meant instead.
    """

    def __init__(self, at: int, others: Sequence[int]) -> None:
        self._watched = (at, *others) if others else ()
        self._changed = dict.fromkeys(self._watched, False)
        self.value = ""

    def watched(self, rows: Iterable[Row]) -> Iterator[Row]:
        """The rows, while it looks at them."""
        first: Sequence[str] = ()
        for line, fields in rows:
            if self._watched:
                first = first or fields
                for k in self._watched:
                    self._changed[k] |= fields[k] != first[k]
            yield line, fields
        if first:
            self.value = first[self._watched[0]].strip()

    @property
    def found(self) -> int | None:
        """The column that changes in place of the other one."""
        if not self._watched or self._changed[self._watched[0]]:
            return None
        return next((k for k in self._watched[1:] if self._changed[k]), None)
