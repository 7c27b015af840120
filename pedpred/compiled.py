"""Loops that are compiled for the processor, and the cache of their machine code.

They run in the calling thread, without the interpreter's lock: worker processes share the cores, and waiting
threads would take them from a robot's other processes. Forked processes and several threads may call them.
Compiling is announced.

The cache is one folder per user (`cache_folder`). Each file there is named after all that its machine code
depends on: the content of the loop and of the loops that it calls (`contents`), the types of the arguments,
the versions of the compilers, and the processor. So no file becomes stale, and several versions of this
package share the folder. A cache that cannot be read or written is no error: every process compiles then.

This relies on the attribute `_cache` of numba's dispatchers, on `CompileResult._reduce`,
`CompileResult._rebuild` and `IndexDataCacheFile._load_data`. With a version of numba that lacks one of them,
nothing is cached.
"""

from __future__ import annotations

import builtins
import dis
import functools
import hashlib
import importlib.metadata
import logging
import os
import platform
from collections.abc import Callable
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba import njit, types
from numba.core import caching, compiler, config, serialize
from numba.core.event import Event, Listener, register

from pedpred.files import atomic_write, read_bytes

_LOG = logging.getLogger(__name__)
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
_SETTINGS = ("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "USING_SVML", "BOUNDSCHECK", "DEBUGINFO_DEFAULT")
"""Settings of numba that change machine code, besides those of the processor."""
_CHECKSUM_BYTES = 32
_MODULES = ("math", "numpy")
"""Modules that loops may read: their content changes with a version of Python or numpy only."""
_CODE = (
    *("co_code", "co_exceptiontable", "co_flags", "co_argcount", "co_kwonlyargcount"),
    *("co_names", "co_varnames", "co_freevars", "co_cellvars"),
)
"""Parts of a function's code that count besides its constants; Python 3.10 has no table of exceptions."""
_PLAIN = (int, float, complex, str, bytes, bool, type(None), type(Ellipsis), np.generic)
_FIRST: dict[FunctionType, Any] = {}
"""Content of each loop when it was first asked for; compiled code may contain that from then on."""


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function at its first call; a division by zero gives inf or nan, as in numpy."""
    loop: Any = njit(**_OPTIONS)(function)
    if loop is not function:  # which it is if numba's compiler is switched off
        loop._cache = _Cache(loop.py_func)
    return loop


def cache_folder() -> Path:
    """Folder of compiled code: in `$NUMBA_CACHE_DIR`, else in the user's folder for caches.

    Raises:
        RuntimeError: the user has no home.
    """
    if named := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(named).absolute() / "pedpred"
    caches = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (caches if caches.is_absolute() else Path.home() / ".cache") / "pedpred" / "compiled"


class _Cache(caching.NullCache):
    """Machine code of one loop: a file for each list of argument types.

    A file holds what numba serializes, then a checksum, so that a damaged one is not loaded.
    """

    def __init__(self, loop: Any):
        self._loop = loop

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return the compiled code for some types of arguments; None if it has no file or a damaged one."""
        target.refresh()
        name = self._name(signature, target.codegen())
        if name is None:
            return None
        try:
            path = cache_folder() / name
            raw = read_bytes(path)
            if _checksum(raw[:-_CHECKSUM_BYTES]) != raw[-_CHECKSUM_BYTES:]:
                return None
            whole = caching.IndexDataCacheFile(str(path.parent), "", "")._load_data(name)
            return compiler.CompileResult._rebuild(target, *whole)
        except Exception:  # a file that cannot be used is written again
            return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Write compiled code; log a warning once where that is impossible."""
        name = self._name(signature, result.codegen)
        if name is None or result.lifted or result.library.has_dynamic_globals:
            return
        try:
            path = cache_folder() / name
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            data = serialize.dumps(result._reduce())
            with atomic_write(path) as new:
                new.write_bytes(data + _checksum(data))
        except Exception as cause:  # the compiled code works all the same
            _warn_once(type(cause).__name__)

    def _name(self, signature: Any, codegen: Any) -> str | None:
        """File name for some types of arguments; None if the loop has changed in this process."""
        code = contents(self._loop)
        if code is None:
            return None
        arguments = [_describe(kind) for kind in getattr(signature, "args", signature)]
        everything = repr((code, arguments, codegen.magic_tuple(), _versions()))
        return f"{self._loop.__qualname__}-{_checksum(everything.encode()).hex()[:40]}.loop"


def _describe(kind: Any) -> Any:
    """A type of numba, with the names of fields, which become places."""
    if isinstance(kind, types.Dispatcher):
        raise TypeError(f"{kind}: a compiled loop cannot be the argument of another one")
    if isinstance(kind, types.BaseTuple):
        fields = getattr(kind, "instance_class", None), getattr(kind, "fields", ())
        parts: Any = kind
        return type(kind).__name__, fields, [_describe(part) for part in parts]
    return str(kind)


@functools.cache
def _versions() -> tuple[Any, ...]:
    packages = [(name, importlib.metadata.version(name)) for name in ("numba", "llvmlite", "numpy")]
    settings = [(name, getattr(config, name, None)) for name in _SETTINGS]
    return platform.python_implementation(), platform.python_version(), packages, settings, _OPTIONS


def _checksum(raw: bytes) -> bytes:
    return hashlib.sha256(raw).digest()


@functools.cache
def _warn_once(error: str) -> None:
    """Log once in a process that there is no cache."""
    _LOG.warning(
        "compiled code cannot be kept (%s): every process compiles it again; "
        "set NUMBA_CACHE_DIR to a folder that can be written",
        error,
    )


def contents(loop: FunctionType) -> list[Any] | None:
    """All that is compiled into a loop: its code and constants, and those of the loops that it calls.

    Constants count with their values, also those of other modules; docstrings do not count.

    Returns:
        Plain values whose `repr` is the same in every process. None if a loop has changed in this process,
        where the former one may have been compiled already.

    Raises:
        TypeError: a loop reads an object of a kind that `_value` does not know.
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
    """Values that a loop reads by name, from its module and its enclosing functions, and its defaults."""
    known = {**vars(builtins), **loop.__globals__}
    enclosing = zip(loop.__code__.co_freevars, loop.__closure__ or (), strict=True)
    read = {name: known.get(name) for name in _names(loop.__code__)}
    return {"": loop.__defaults__, **read, **{name: cell.cell_contents for name, cell in enclosing}}


@functools.cache
def _names(code: CodeType) -> frozenset[str]:
    """The global names in some code, and in the functions inside it."""
    read = {step.argval for step in dis.get_instructions(code) if step.opname == "LOAD_GLOBAL"}
    return frozenset(read).union(*(_names(inner) for inner in code.co_consts if isinstance(inner, CodeType)))


@functools.cache
def _code(code: CodeType, docstring: str | None = None) -> tuple[Any, ...]:
    """A function's instructions and constants, without its docstring and line numbers."""
    consts = list(code.co_consts)
    if docstring is not None and consts[:1] == [docstring]:
        consts[0] = ""
    return *(getattr(code, part, b"") for part in _CODE), [_value(const, code.co_name) for const in consts]


def _value(value: Any, where: str) -> Any:
    """Type and content of a value.

    Raises:
        TypeError: it is of another kind than the ones below.
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


class _Announcement(Listener):
    """Log once in a process that compiling takes a while."""

    announced = False

    def on_start(self, event: Event) -> None:
        """Log at the first loop of this package."""
        if not self.announced and event.data["dispatcher"].py_func.__module__.startswith("pedpred."):
            self.announced = True
            _LOG.warning(
                "compiling loops for this processor: takes some seconds, once per user and version; "
                "`pedpred warm-up` does it beforehand"
            )

    def on_end(self, event: Event) -> None:
        """Do nothing."""


register("numba:compile", _Announcement())
