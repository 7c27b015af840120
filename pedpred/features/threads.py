"""How many threads the compiled loops of this package use."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from numba import get_num_threads, set_num_threads

PARALLEL_ROWS = 1024
"""Fewer rows run in one thread: waking the others costs milliseconds on a busy machine."""


@contextmanager
def threads_for(rows: int) -> Iterator[None]:
    """Run numba's parallel loops over `rows` rows with as many threads as pay off."""
    before = get_num_threads()
    set_num_threads(before if rows >= PARALLEL_ROWS else 1)
    try:
        yield
    finally:
        set_num_threads(before)
