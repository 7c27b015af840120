"""Errors of this package. Their constructors take facts and compose the message.

A message names the file (with line or field) or the field that is wrong, the value and the rule. Libraries
know neither configuration keys nor DVC; `pedpred.config` adds both for stages. Programs run in `user_errors`.
"""

from __future__ import annotations

import errno
import os
import reprlib
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS})
"""The system's numbers for a full disk or quota, a file that is too large, and a disk that is read-only."""

_NO_ACCESS = frozenset({errno.EACCES, errno.EPERM})

ROOM_REMEDY = "Nothing half-written was kept; make room on the disk or the folder writable, and try again"

_LONGEST_VALUE, _LONGEST_PROBLEM = 400, 1000
_MOST_BITS = 512


class _Brief(reprlib.Repr):
    """`repr` of a part of a value, of which the rest is left out."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel = 8
        self.maxtuple = self.maxlist = self.maxdict = self.maxset = self.maxfrozenset = 100
        self.maxstring = self.maxlong = self.maxother = _LONGEST_VALUE

    def repr_int(self, x: int, level: int) -> str:
        """Python refuses to write numbers of more than some thousand digits."""
        many = x.bit_length() > _MOST_BITS
        return f"a whole number of {x.bit_length()} bits" if many else super().repr_int(x, level)


_BRIEF = _Brief()


def brief(value: object) -> str:
    """Write a value into a message: as `repr` does, but at most a few lines, whatever the value holds."""
    return _cut(_BRIEF.repr(value), _LONGEST_VALUE)


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else f"{text[:longest]}..."


class PedpredError(Exception):
    """Base of all errors that a user of pedpred can cause and can repair. Worker processes can pickle it."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Restore message and attributes; constructors have other arguments than `args`."""
        return _restore, (type(self), self.args), self.__dict__


def _restore(kind: type[PedpredError], args: tuple[Any, ...]) -> PedpredError:
    error = kind.__new__(kind)
    error.args = args
    return error


class ValueRuleError(PedpredError):
    """A field of a value object breaks its rule."""

    def __init__(self, field: str, value: object, rule: str):
        super().__init__(f"{field} = {brief(value)}, but {rule}")
        self.field, self.value, self.rule = field, value, rule


def shape_error(field: str, shape: Sequence[int], expected: str) -> ValueRuleError:
    """Make the error of an array that has the wrong shape."""
    return ValueRuleError(field, tuple(shape), f"its shape must be {expected}")


class ConfigError(PedpredError):
    """A configuration key, option or combination is not understood."""

    def __init__(self, key: str, value: object, remedy: str):
        super().__init__(f"configuration key '{key}' = {brief(value)}: {remedy}")
        self.field, self.value, self.remedy = key, value, remedy


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
