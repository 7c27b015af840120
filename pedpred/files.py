"""Bounded reading and atomic writing of files.

Reading: `translate_errors` turns what a decoder raises on damaged bytes into an error that names the file;
`read_bytes`, `read_json`, `read_yaml` and `read_picture` are bounded in size; `check_input`
refuses what is missing before its content is read.
Writing: `check_output` refuses a bad place before work begins; `atomic_write` replaces a file when the new
one is complete.
"""

from __future__ import annotations

import glob
import json
import math
import os
import secrets
import sqlite3
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pedpred.errors import NO_ROOM, ROOM_REMEDY, InputError, OutputError, PedpredError, ValueRuleError
from pedpred.plain import parse_json, parse_yaml

if TYPE_CHECKING:
    from PIL import Image

MOST_PIXELS = 2**26
"""Limit for a picture or a map: 400 m x 400 m in cells of 5 cm."""

SCRATCH = Path("build")
"""Folder for scratch data, on the project's disk: the system's temporary folder is often in memory."""

_LARGEST_BYTES, _LARGEST_JSON_BYTES, _LARGEST_YAML_BYTES = 2**30, 2**22, 2**18
_PICTURES = ("PNG", "PPM", "BMP", "JPEG", "TIFF")  # formats that are decoded here, not by another program
_LEFTOVER_S = 86400.0
"""Age from which a temporary file is that of a killed writer."""
_ALLOWED = {False: ("file",), True: ("folder",), None: ("file", "folder")}
"""Whether a path is that of a folder -> what may be there."""

Wording = Callable[[str], PedpredError]
"""Makes the error for a problem, with the file and the remedy."""


def as_path(field: str, value: Any) -> Path:
    """Take an argument as a path.

    Raises:
        ValueRuleError: it is neither text nor a path.
    """
    try:
        return Path(value)
    except TypeError as cause:
        raise ValueRuleError(field, value, "it must be a path: text or pathlib.Path") from cause


# Reading


@contextmanager
def translate_errors(wording: Wording) -> Iterator[None]:
    """Translate any exception inside the block into an error that names the file; the cause is chained.

    Every `Exception` counts, since decoders document no complete list of what they raise on damaged bytes. An
    error that already names a file passes.

    Args:
        wording: such as `partial(InputError, path, "file", remedy=...)`.
    """
    try:
        yield
    except (InputError, OutputError):
        raise
    except Exception as cause:
        raise wording(" ".join(_problem(cause).split())) from cause


def _problem(cause: Exception) -> str:
    if isinstance(cause, KeyError):
        return f"{cause} is missing"
    if isinstance(cause, FileNotFoundError):
        return f"there is no such file or folder{f': {cause.filename}' if cause.filename else ''}"
    return str(cause) if isinstance(cause, PedpredError) else f"{type(cause).__name__}: {cause}"


def check_input(path: Path, folder: bool | None = None) -> None:
    """Check that an input exists, and is no pipe or device, before its content is read.

    Args:
        path: of the input.
        folder: whether it must be a folder; None: a file or a folder.

    Raises:
        InputError: it is not.
    """
    found, allowed = _kind(path), " or ".join(_ALLOWED[folder])
    if found not in _ALLOWED[folder]:
        problem = f"it is a {found}" if found else f"there is no such {allowed}"
        raise InputError(path, None, problem, f"Name a {allowed}")


def _kind(path: Path) -> str:
    """Return what exists at a path: "file", "folder", "pipe or device", or "" for nothing."""
    if not os.path.exists(path):  # which is false for impossible names
        return ""
    return "file" if path.is_file() else "folder" if path.is_dir() else "pipe or device"


def read_bytes(path: Path, largest: int = _LARGEST_BYTES) -> bytes:
    """Read a file of at most `largest` bytes.

    Raises:
        OSError: the file cannot be read.
        ValueRuleError: it is larger.
    """
    size = path.stat().st_size
    if size > largest:
        raise ValueRuleError("size", size, f"at most {largest} bytes are read")
    with path.open("rb") as file:
        return file.read(size)


def read_json(path: Path, wording: Wording) -> dict[str, Any]:
    """Read the object in a JSON file.

    Args:
        path: the file.
        wording: of the error, see `translate_errors`.

    Raises:
        InputError: the file is missing, too large or no JSON, or its content is not an object.
    """
    with translate_errors(wording):
        return _mapping(parse_json(read_bytes(path, _LARGEST_JSON_BYTES)))


def read_yaml(path: Path, wording: Wording) -> dict[str, Any]:
    """Read the mapping in a YAML file (safe subset); arguments and errors as in `read_json`."""
    with translate_errors(wording):
        return _mapping(parse_yaml(read_bytes(path, _LARGEST_YAML_BYTES)))


def _mapping(content: Any) -> dict[str, Any]:
    if not isinstance(content, dict):
        raise TypeError(f"{type(content).__name__}, expected an object")
    return content


def limit_values(database: sqlite3.Connection, most_bytes: int) -> None:
    """Refuse values of a database that are larger; Python 3.10 cannot, and reads up to 1 GB there."""
    if sys.version_info >= (3, 11):
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, most_bytes)


@contextmanager
def open_picture(path: Path, wording: Wording) -> Iterator[Image.Image]:
    """Open a picture whose pixels are not decoded yet; errors inside the block name the file.

    Raises:
        InputError: the file is missing, no picture, damaged or has more than `MOST_PIXELS`.
    """
    from PIL import Image  # late: a robot has no Pillow

    with translate_errors(wording), Image.open(path, formats=_PICTURES) as image:
        if math.prod(image.size) > MOST_PIXELS:
            raise ValueRuleError("size", image.size, f"it must be at most {MOST_PIXELS} pixels")
        yield image


def read_picture(path: Path, mode: str, wording: Wording) -> np.ndarray:
    """Read a picture as [rows, columns] (mode "L") or [rows, columns, 3] ("RGB") uint8.

    Raises:
        InputError: see `open_picture`.
    """
    with open_picture(path, wording) as image:
        return np.asarray(image.convert(mode))


# Writing


def check_output(path: Path, folder: bool | None = False) -> None:
    """Check that a file can be written at `path`, or a folder, before work begins; leave nothing behind.

    Args:
        path: of the output; an existing one may be replaced.
        folder: whether it will be a folder; None: either.

    Raises:
        OutputError: `path` is of another kind, or its parent cannot be written.
    """
    found = _kind(path)
    if found and found not in _ALLOWED[folder]:
        raise OutputError(path, f"a {found} is there, and the output is a {' or '.join(_ALLOWED[folder])}")
    here = path.absolute()
    inside = here if found == "folder" else next(above for above in here.parents if _kind(above))
    try:
        tempfile.TemporaryDirectory(prefix=f".{path.name}.", suffix=".tmp", dir=inside).cleanup()
    except (OSError, ValueError) as cause:
        raise OutputError(path, getattr(cause, "strerror", None) or str(cause)) from cause


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Yield a temporary path to write to; it replaces `path` when the block ends without an error.

    Readers see the old file or the complete new one, also when the process is killed. Of concurrent writers
    of one file, the last one to finish wins. The folder of `path` is made if needed.

    Raises:
        OutputError: the disk is full or read-only; nothing half-written is kept.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    _remove_leftovers(path)
    new = path.with_name(f".{path.stem}.{secrets.token_hex(4)}.tmp{path.suffix}")
    try:
        yield new
        with new.open("rb") as file:
            os.fsync(file.fileno())
        new.replace(path)
    except OSError as cause:
        if cause.errno not in NO_ROOM:
            raise
        raise OutputError(path, os.strerror(cause.errno), ROOM_REMEDY) from cause
    finally:
        new.unlink(missing_ok=True)


def _remove_leftovers(path: Path) -> None:
    """Remove the temporary files of writers of `path` that were killed."""
    stem, suffix = glob.escape(path.stem), glob.escape(path.suffix)
    for left in path.parent.glob(f".{stem}.{8 * '[0-9a-f]'}.tmp{suffix}"):
        with suppress(OSError):
            if left.lstat().st_mtime < time.time() - _LEFTOVER_S:
                left.unlink()


def write_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8) atomically; see `atomic_write`."""
    with atomic_write(path) as new:
        new.write_text(text, encoding="utf-8")


def write_json(path: Path, content: object) -> None:
    """Write JSON atomically, one value per line, in the given order; see `atomic_write`."""
    write_text(path, json.dumps(content, indent=1) + "\n")
