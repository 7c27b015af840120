"""Errors of this package. Their constructors take facts and compose the message.

A message names the file (with line or field) or the field that is wrong, the value and the rule. Libraries
know neither configuration keys nor DVC; `pedpred.config` adds both for stages. Programs run in `user_errors`.
"""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS})
"""The system's numbers for a full disk or quota, a file that is too large, and a disk that is read-only."""

_NO_ACCESS = frozenset({errno.EACCES, errno.EPERM})

ROOM_REMEDY = "Nothing half-written was kept; make room on the disk or the folder writable, and try again"

_LONGEST_VALUE, _LONGEST_PROBLEM, _DEEPEST = 400, 1000, 8
_MOST_BITS = 512
_BRACKETS: dict[type, tuple[str, str]] = {
    list: ("[", "]"),
    tuple: ("(", ")"),
    set: ("{", "}"),
    frozenset: ("frozenset({", "})"),
    dict: ("{", "}"),
}


def brief(value: object) -> str:
    """Write a value into a message: as `repr` does, but at most a few lines, whatever the value holds.

    What is left out is never looked at, so that a file of a few bytes cannot make a huge text.
    """
    return _cut("".join(_pieces(value, _LONGEST_VALUE, _DEEPEST)), _LONGEST_VALUE)


def _pieces(value: object, room: int, deepest: int) -> Iterator[str]:
    """Yield the parts of a value's text, until `room` characters are full."""
    if type(value) in _BRACKETS:
        yield from _entries(value, room, deepest)  # type: ignore[arg-type]
    elif isinstance(value, str | bytes):
        yield repr(value[: room + 1])
    elif isinstance(value, int) and value.bit_length() > _MOST_BITS:
        yield f"a whole number of {value.bit_length()} bits"
    else:
        yield repr(value)


def _entries(values: Iterable[object], room: int, deepest: int) -> Iterator[str]:
    opening, closing = _BRACKETS[type(values)]
    if not values and type(values) in (set, frozenset):
        yield repr(values)
        return
    yield opening
    for number, entry in enumerate(values):
        if room <= 0 or not deepest:
            yield "..."
            break
        parts = [", "] if number else []
        parts += _pieces(entry, room, deepest - 1)
        if isinstance(values, dict):
            parts += [": ", *_pieces(values[entry], room, deepest - 1)]
        room -= sum(map(len, parts))
        yield from parts
    else:
        if isinstance(values, tuple) and len(values) == 1:
            yield ","
    yield closing


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else f"{text[:longest]}..."


class PedpredError(Exception):
    """Base of all errors that a user of pedpred can cause and can repair. Worker processes can pickle it."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Restore message and attributes; constructors have other arguments than `args`."""
        return _restored, (type(self), self.args), self.__dict__


def _restored(kind: type[PedpredError], args: tuple[Any, ...]) -> PedpredError:
    error = kind.__new__(kind)
    error.args = args
    return error


class ShapeError(PedpredError):
    """An array has the wrong shape."""

    def __init__(self, field: str, shape: Sequence[int], expected: str):
        super().__init__(f"{field} has shape {tuple(shape)}, expected {expected}")
        self.field = field


class ValueRuleError(PedpredError):
    """A field of a value object breaks its rule."""

    def __init__(self, field: str, value: object, rule: str):
        super().__init__(f"{field} = {brief(value)}, but {rule}")
        self.field, self.value, self.rule = field, value, rule


class ConfigError(PedpredError):
    """A configuration key, option or combination is not understood."""

    def __init__(self, key: str, value: object, remedy: str):
        super().__init__(f"configuration key '{key}' = {brief(value)}: {remedy}")
        self.field, self.value = key, value


class InputError(PedpredError):
    """A file or folder that is read cannot be used; the message names it, the problem and the remedy.

    Args:
        path: of the file.
        where: number of a line, or name of a column or entry; None: the file as a whole.
        problem: what is wrong.
        remedy: what to do.

    Attributes:
        path: of the file.
        where: see above.
        problem: the message without its remedy.
    """

    def __init__(
        self,
        path: Path,
        where: int | str | None,
        problem: str,
        remedy: str = "Correct the file or fetch it again",
    ):
        place = f", line {where}" if isinstance(where, int) else f", {where}" if where else ""
        about, what = (_cut(text, _LONGEST_PROBLEM) for text in (f"{path}{place}", problem))
        self.path, self.where, self.problem = Path(path), where, f"{about}: {what}"
        super().__init__(f"{self.problem}{f'. {remedy}' if remedy else ''}")


class OutputError(PedpredError):
    """A file or folder cannot be written where it was asked for."""

    def __init__(self, path: Path, problem: str, remedy: str = "Name another file or folder"):
        about, what = (_cut(text, _LONGEST_PROBLEM) for text in (str(path), problem))
        super().__init__(f"{about}: it cannot be written: {what}{f'. {remedy}' if remedy else ''}")
        self.path = Path(path)


class FetchError(PedpredError):
    """No configured mirror has the raw data; `damaged` if one has files that are not what they must be."""

    def __init__(self, data_set: str, files: Sequence[str], tried: Mapping[str, str], damaged: bool = False):
        attempts = "; ".join(f"{place}: {lack}" for place, lack in tried.items()) or "no mirrors"
        super().__init__(
            f"no mirror has unaltered files of {data_set}. Download its archive by other means and put "
            f"{' '.join(files)} into the folder mirror/{data_set}, or name the folder that holds them: "
            f"PEDPRED_MIRROR=/my/folder. Tried were {attempts}."
        )
        self.damaged = damaged


@contextmanager
def user_errors() -> Iterator[None]:
    """End the process with a message alone where a person can repair what is wrong, or has interrupted it."""
    try:
        yield
        sys.stdout.flush()
    except KeyboardInterrupt:
        raise SystemExit(130) from None  # as shells report the signal
    except BrokenPipeError:  # nobody reads the output any more
        _end_output()
        raise SystemExit(141) from None
    except PedpredError as error:
        raise SystemExit(f"{type(error).__name__}: {error}") from error
    except OSError as error:
        if error.filename is None and error.errno not in NO_ROOM:
            raise
        _end_output()
        remedy = f". {ROOM_REMEDY}" if error.errno in NO_ROOM | _NO_ACCESS else ""
        raise SystemExit(f"{error}{remedy}") from error


def _end_output() -> None:
    """Print what is not printed yet, or let it go: Python would try once more when it ends, and fail."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
