"""What a compiled loop consists of: loops with the same contents are compiled to the same machine code."""

from __future__ import annotations

import builtins
import dis
import functools
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

_MODULES = ("math", "numpy")
"""Modules that loops may read: what is in them changes with a version of Python or numpy only."""
_CODE = (
    *("co_code", "co_exceptiontable", "co_flags", "co_argcount", "co_kwonlyargcount"),
    *("co_names", "co_varnames", "co_freevars", "co_cellvars"),
)
"""What of a function's code counts besides its constants; Python 3.10 has no table of exceptions."""
_PLAIN = (int, float, complex, str, bytes, bool, type(None), type(Ellipsis), np.generic)
_FIRST: dict[FunctionType, Any] = {}
"""What each loop was when it was first asked for; compiled code may contain that from then on."""


def contents(loop: FunctionType) -> list[Any] | None:
    """All that is compiled into a loop: its code and constants, and those of the loops that it calls.

    Constants count with their values, also those of other modules; documentation does not count.

    Returns:
        Plain values whose `repr` is the same in every process. None if a loop has changed in this process,
        where the former one may have been compiled already.

    Raises:
        TypeError: a loop reads something whose content cannot be told.
    """
    loops, parts = [loop], []
    for one in loops:  # grows
        read: list[Any] = []
        called: list[Any] = []
        for name, value in sorted(_globals(one).items()):
            other = getattr(value, "py_func", None)
            if other is None:
                read.append((name, _value(value, f"{one.__module__}.{one.__qualname__} reads {name}")))
                continue
            if other not in loops:
                loops.append(other)
            called.append((name, loops.index(other)))
        content = one.__module__, one.__qualname__, _code(one.__code__, one.__doc__), read
        if _FIRST.setdefault(one, content) != content:
            return None
        parts.append((content, called))
    return parts


def _globals(loop: FunctionType) -> dict[str, Any]:
    """What a loop reads by name, from its module and from around it, and its defaults."""
    known = {**vars(builtins), **loop.__globals__}
    around = zip(loop.__code__.co_freevars, loop.__closure__ or (), strict=True)
    read = {name: known.get(name) for name in _names(loop.__code__)}
    return {"": loop.__defaults__, **read, **{name: cell.cell_contents for name, cell in around}}


@functools.cache
def _names(code: CodeType) -> frozenset[str]:
    """The global names in some code, and in the functions inside it."""
    read = {step.argval for step in dis.get_instructions(code) if step.opname == "LOAD_GLOBAL"}
    return frozenset(read).union(*(_names(inner) for inner in code.co_consts if isinstance(inner, CodeType)))


@functools.cache
def _code(code: CodeType, documentation: str | None = None) -> tuple[Any, ...]:
    """A function's instructions and constants, without its documentation and line numbers."""
    consts = list(code.co_consts)
    if documentation is not None and consts[:1] == [documentation]:
        consts[0] = ""
    return *(getattr(code, part, b"") for part in _CODE), [_value(const, code.co_name) for const in consts]


def _value(value: Any, where: str) -> Any:
    """What tells a value from others.

    Raises:
        TypeError: nothing is known that does.
    """
    kind = type(value)
    about = f"{kind.__module__}.{kind.__qualname__}"
    if isinstance(value, _PLAIN):
        return about, repr(value)
    if isinstance(value, tuple):
        return about, getattr(kind, "_fields", ()), [_value(part, where) for part in value]
    if isinstance(value, frozenset):
        return about, sorted(repr(_value(part, where)) for part in value)
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return about, value.dtype.descr, value.shape, value.strides, value.tobytes()
    if isinstance(value, CodeType):
        return about, _code(value)
    if isinstance(value, ModuleType) and value.__name__.partition(".")[0] in _MODULES:
        return about, value.__name__
    if isinstance(value, type | BuiltinFunctionType) and value.__module__ in ("builtins", *_MODULES):
        return about, value.__module__, value.__qualname__
    raise TypeError(f"{where}, a {about}: a compiled loop may read numbers, strings, arrays and other loops")
