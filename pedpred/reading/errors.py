"""Errors in the content of a file: readers raise them without the path, which `add_path` adds."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from pedpred.errors import InputError, PedpredError
from pedpred.files import translate_errors

CORRECT = "Correct the file or fetch it again"
NO_PEDESTRIAN = "Only pedestrians are read: name a recording with some"
NO_DOCTYPE = ("a document type, which could define entities", "Remove the line <!DOCTYPE ...>")
"""XML with a document type is refused: problem and remedy."""


class ContentError(PedpredError):
    """A file cannot be understood.

    Attributes:
        problem: what is wrong.
        remedy: what to do.
        line: of the file, from 1; None: it is not about a line.
    """

    def __init__(self, problem: str, remedy: str = CORRECT, line: int | None = None):
        super().__init__(problem)
        self.problem, self.remedy, self.line = problem, remedy, line


def row_error(row: int, before: int | None, problem: str, remedy: str = CORRECT) -> ContentError:
    """Make an error about a row.

    Args:
        row: its number, from 0.
        before: lines of a text before the first row; None: the file has no lines.
        problem: what is wrong.
        remedy: what to do.
    """
    if before is None:
        return ContentError(f"row {row + 1}: {problem}", remedy)
    return ContentError(problem, remedy, before + int(row) + 1)


@contextmanager
def add_path(path: Path) -> Iterator[None]:
    """Turn whatever is raised inside into a `InputError` with the path, the line and the remedy."""
    with translate_errors(partial(InputError, path, None)):
        try:
            yield
        except ContentError as cause:
            raise InputError(path, cause.line, cause.problem, cause.remedy) from cause
