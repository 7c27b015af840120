"""Loops that are compiled for the processor.

They run in the calling thread, without the interpreter's lock: worker processes share the cores, and threads
that wait for work would take them from a robot's other processes. Forked processes and several threads may
call them. Compiling is announced, and the compiled code is kept in one folder per user (`cache_folder`).

Each file there is named after all that its machine code depends on: the contents of the loop and of the loops
that it calls (`pedpred.contents`), the types of the arguments, the versions of what compiles, and the
processor. A loop of which any of these has changed is compiled again, and several versions of this package
keep their code side by side. Whatever happens to the folder is no error: without it, every process compiles.

This relies on the attribute `_cache` of numba's dispatchers, with the methods of its `NullCache`, and on
`CompileResult._reduce`, `CompileResult._rebuild` and `IndexDataCacheFile._load_data`. With a version of numba
that lacks one of them, nothing is kept.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import logging
import os
import platform
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba import njit, types
from numba.core import caching, compiler, config, serialize
from numba.core.event import Event, Listener, register

from pedpred.contents import contents
from pedpred.files import atomic_write, read_bytes

_LOG = logging.getLogger(__name__)
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
_SETTINGS = ("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "USING_SVML", "BOUNDSCHECK", "DEBUGINFO_DEFAULT")
"""Settings of numba that change machine code, besides those of the processor."""
_CHECKSUM_BYTES = 32
_UNUSED_S = 180 * 86400.0
"""Files that nobody has used for so long are removed."""


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function at its first call; a division by zero gives inf or nan, as in numpy."""
    loop: Any = njit(**_OPTIONS)(function)
    if loop is not function:  # which it is if numba is told to compile nothing
        loop._cache = _Kept(loop.py_func)
    return loop


def cache_folder() -> Path:
    """Where compiled code is kept: in `$NUMBA_CACHE_DIR`, else in the user's folder for caches.

    Raises:
        RuntimeError: the user has no home.
    """
    if named := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(named).absolute() / "pedpred"
    caches = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (caches if caches.is_absolute() else Path.home() / ".cache") / "pedpred" / "compiled"


class _Kept:
    """What was compiled of one loop: a file for each list of argument types.

    A file holds what numba writes of compiled code, then a checksum, so that a damaged one is not loaded.
    """

    def __init__(self, loop: Any):
        self._loop = loop

    @property
    def cache_path(self) -> str:
        """The folder."""
        return str(cache_folder())

    def load_overload(self, signature: Any, target: Any) -> Any:
        """The compiled code for some types of arguments; None if there is none or its file is damaged."""
        target.refresh()
        name = self._name(signature, target.codegen())
        if name is None:
            return None
        try:
            path = cache_folder() / name
            raw = read_bytes(path)
            if _checksum(raw[:-_CHECKSUM_BYTES]) != raw[-_CHECKSUM_BYTES:]:
                return None
            with suppress(OSError):
                os.utime(path)
            whole = caching.IndexDataCacheFile(str(path.parent), "", "")._load_data(name)
            return compiler.CompileResult._rebuild(target, *whole)
        except Exception:  # whatever is wrong with a file, it will be written again
            return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep compiled code; where that is impossible, say so once."""
        name = self._name(signature, result.codegen)
        if name is None or result.lifted or result.library.has_dynamic_globals:
            return
        place = ""
        try:
            path = cache_folder() / name
            place = f" in {path.parent}"
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            data = serialize.dumps(result._reduce())
            with atomic_write(path) as new:
                new.write_bytes(data + _checksum(data))
            _tidy(path.parent)
        except Exception as cause:  # the compiled code works all the same
            reasons = (getattr(error, "strerror", None) for error in (cause, cause.__cause__))
            _warn(f"compiled code cannot be kept{place}: {next(filter(None, reasons), cause)}")

    def flush(self) -> None:
        """Nothing to forget: no file becomes stale."""

    def _name(self, signature: Any, codegen: Any) -> str | None:
        """File name for some types of arguments; None if the loop has changed in this process."""
        code = contents(self._loop)
        if code is None:
            return None
        arguments = [_described(kind) for kind in getattr(signature, "args", signature)]
        everything = repr((code, arguments, codegen.magic_tuple(), _versions()))
        return f"{self._loop.__qualname__}-{_checksum(everything.encode()).hex()[:40]}.loop"


def _described(kind: Any) -> Any:
    """A type of numba, with the names of fields, which become places."""
    if isinstance(kind, types.Dispatcher):
        raise TypeError(f"{kind}: a compiled loop cannot be the argument of another one")
    if isinstance(kind, types.BaseTuple):
        fields = getattr(kind, "instance_class", None), getattr(kind, "fields", ())
        parts: Any = kind
        return type(kind).__name__, fields, [_described(part) for part in parts]
    return str(kind)


@functools.cache
def _versions() -> tuple[Any, ...]:
    packages = [(name, importlib.metadata.version(name)) for name in ("numba", "llvmlite", "numpy")]
    settings = [(name, getattr(config, name, None)) for name in _SETTINGS]
    return platform.python_implementation(), platform.python_version(), packages, settings, _OPTIONS


def _checksum(raw: bytes) -> bytes:
    return hashlib.sha256(raw).digest()


@functools.cache
def _warn(message: str) -> None:
    """Log a warning once in a process."""
    _LOG.warning(message)


@functools.cache
def _tidy(folder: Path) -> None:
    """Remove what nobody uses any more, once in a process."""
    for path in folder.glob("*.loop"):
        with suppress(OSError):
            if path.stat().st_mtime < time.time() - _UNUSED_S:
                path.unlink()


class _Announcement(Listener):
    """Log once in a process that compiling takes a while."""

    announced = False

    def on_start(self, event: Event) -> None:
        """Look whose function it is."""
        if not self.announced and event.data["dispatcher"].py_func.__module__.startswith("pedpred."):
            self.announced = True
            _LOG.warning(
                "compiling loops for this processor: takes some seconds, once per user and version; "
                "`pedpred warm-up` does it beforehand"
            )

    def on_end(self, event: Event) -> None:
        """Nothing to say."""


register("numba:compile", _Announcement())
