"""Arrays larger than memory: their rows lie in unnamed, memory-mapped files.

The system loads the pages that are read and drops them when memory is short, so a data set of any size needs
no memory of its own. A killed process leaves no file.
"""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Iterable

import numpy as np

from pedpred.errors import shape_error
from pedpred.files import SCRATCH


class MappedRows:
    """An array that grows by blocks of rows on disk, [M, ...]; the first block sets width and type."""

    def __init__(self, name: str) -> None:
        """Begin without rows.

        Args:
            name: of the array, for errors.

        Raises:
            OSError: no file can be made in `SCRATCH`.
        """
        SCRATCH.mkdir(exist_ok=True)
        self._name = name
        self._file = tempfile.TemporaryFile(buffering=0, dir=SCRATCH)  # noqa: SIM115, closed with this object
        weakref.finalize(self, self._file.close)  # a mapping outlives its file
        self._rows: np.ndarray | None = None  # a block without rows
        self._count = 0

    def __len__(self) -> int:
        """Number of rows so far."""
        return self._count

    def append(self, rows: np.ndarray) -> None:
        """Add rows behind the others, [m, ...].

        They are written to the file, not assigned through a mapping, where a full disk would end the process.

        Raises:
            ValueRuleError: they are of another width or type than those before.
            OSError: the disk is full.
        """
        like = self._rows = rows[:0].copy() if self._rows is None else self._rows
        if (rows.shape[1:], rows.dtype) != (like.shape[1:], like.dtype):
            expected = f"{(len(rows), *like.shape[1:])} {like.dtype} as before"
            raise shape_error(f"{self._name} ({rows.dtype})", rows.shape, expected)
        data = np.ascontiguousarray(rows).reshape(-1).view(np.uint8).data
        while len(data):
            data = data[self._file.write(data) :]
        self._count += len(rows)

    def extend(self, blocks: Iterable[np.ndarray]) -> None:
        """Add block after block, see `append`."""
        for rows in blocks:
            self.append(rows)

    def array(self) -> np.ndarray:
        """Return all rows that have been added, [M, ...]; the array is valid without this object.

        Raises:
            ValueRuleError: no block was ever added.
        """
        if self._rows is None:
            raise shape_error(self._name, (), "at least one block of rows")
        shape = (self._count, *self._rows.shape[1:])
        if 0 in shape:  # an empty file cannot be mapped
            return np.zeros(shape, self._rows.dtype)
        return np.asarray(np.memmap(self._file, self._rows.dtype, "r+", shape=shape))
