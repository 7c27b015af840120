"""Bounded reading and atomic writing of files.

Reading: `translate_errors` turns what a decoder raises on damaged bytes into an error that names the file;
`read_bytes`, `read_lines`, `read_json`, `read_yaml` and `read_picture` are bounded in size; `check_input`
refuses what is not there before anything is said of its content.
Writing: `check_output` refuses a bad place before work begins; `atomic_write` replaces a file when the new
one is complete; scratch data go to `nameless` files.
"""

from __future__ import annotations

import errno
import fcntl
import itertools
import json
import math
import os
import re
import shutil
import sqlite3
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from io import FileIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pedpred.errors import (
    NO_ROOM,
    ROOM_REMEDY,
    InputError,
    OutputError,
    PedpredError,
    ShapeError,
    ValueRuleError,
)
from pedpred.plain import parse_json, parse_yaml

if TYPE_CHECKING:
    from PIL import Image

MOST_PIXELS = 2**26
"""Limit for a picture or a map: 400 m x 400 m in cells of 5 cm."""

SCRATCH = Path("build")
"""Folder for scratch data, on the project's disk: the system's temporary folder is often in memory."""

_LARGEST_BYTES, _LARGEST_JSON_BYTES, _LARGEST_YAML_BYTES = 2**30, 2**22, 2**18
_LONGEST_LINE, _LONGEST_PROBLEM = 2**16, 600
_PICTURES = ("PNG", "PPM", "BMP", "JPEG", "TIFF")  # formats that are decoded here, not by another program

Wording = Callable[[str], PedpredError]
"""Makes the error for a problem, with the file and the remedy."""


def given_path(field: str, value: Any) -> Path:
    """Take an argument as a path.

    Raises:
        ValueRuleError: it is no path, or one that the system cannot have.
    """
    try:
        path = Path(value)
        os.fsencode(path)
    except (TypeError, UnicodeError) as cause:
        raise ValueRuleError(field, value, "it must be a path: text or pathlib.Path") from cause
    if "\0" in str(path):
        raise ValueRuleError(field, value, "no path has a character 0")
    return path


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
        raise wording(" ".join(_problem(cause).split())[:_LONGEST_PROBLEM]) from cause


def _problem(cause: Exception) -> str:
    if isinstance(cause, KeyError):
        return f"{cause} is missing"
    if isinstance(cause, FileNotFoundError):
        return f"there is no such file or folder{f': {cause.filename}' if cause.filename else ''}"
    return str(cause) if isinstance(cause, PedpredError) else f"{type(cause).__name__}: {cause}"


def check_input(path: Path, folder: bool | None = None) -> None:
    """Check that an input is there, and no pipe or device, before anything is said of its content.

    Args:
        path: of the input.
        folder: whether it must be a folder; None: a file or a folder.

    Raises:
        InputError: it is not.
    """
    called = {False: "file", True: "folder", None: "file or folder"}[folder]
    try:
        if not path.exists():
            raise InputError(path, None, f"there is no such {called}", "Correct the name")
        there = "folder" if path.is_dir() else "file" if path.is_file() else ""
    except OSError as cause:
        raise InputError(path, None, cause.strerror or str(cause), "Correct the name") from cause
    if not there:
        raise InputError(path, None, "it is a pipe or device", "Write it to a file, and name that")
    if there not in called:
        raise InputError(path, None, f"it is a {there}", f"Name a {called}")


def read_bytes(path: Path, largest: int = _LARGEST_BYTES) -> bytes:
    """Read a file of at most `largest` bytes.

    Raises:
        OSError: the file cannot be read.
        ShapeError: it is larger.
    """
    size = path.stat().st_size
    if size > largest:
        raise ShapeError("file", (size,), f"at most {largest} bytes")
    with path.open("rb") as file:
        return file.read(size)


def read_lines(path: Path, encoding: str = "utf-8-sig", errors: str = "strict") -> Iterator[tuple[int, str]]:
    """Number (from 1) and content of each line that is not blank; only one is in memory.

    Args:
        path: the file.
        encoding: of the text.
        errors: name of the handler of bytes that are not text in this encoding, see `codecs.register_error`.

    Raises:
        OSError: the file cannot be read.
        UnicodeError: it is not text in this encoding.
        ShapeError: a line is too long for a text file.
    """
    with path.open(encoding=encoding, errors=errors) as file:
        for number in itertools.count(1):
            line = file.readline(_LONGEST_LINE)
            if len(line) == _LONGEST_LINE:
                raise ShapeError(f"line {number}", (len(line),), f"fewer than {_LONGEST_LINE} characters")
            if not line:
                return
            if not line.isspace():
                yield number, line


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
        kind = "nothing" if content is None else type(content).__name__
        raise TypeError(f"{kind}, expected an object")
    return content


def limit_values(database: sqlite3.Connection, most_bytes: int) -> None:
    """Refuse values of a database that are larger; Python 3.10 cannot, and reads up to 1 GB there."""
    if sys.version_info >= (3, 11):
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, most_bytes)


def _opened_picture(path: Path) -> Image.Image:
    from PIL import Image, UnidentifiedImageError  # late: a robot has no Pillow

    try:
        return Image.open(path, formats=_PICTURES)
    except UnidentifiedImageError as cause:
        kinds = ", ".join(_PICTURES)
        raise ValueError(f"no picture, or of another kind than {kinds}: convert it to PNG") from cause


@contextmanager
def open_picture(path: Path, wording: Wording) -> Iterator[Image.Image]:
    """Open a picture whose pixels are not decoded yet; errors inside the block name the file.

    Raises:
        InputError: the file is missing, no picture, damaged or has more than `MOST_PIXELS`.
    """
    with translate_errors(wording), _opened_picture(path) as image:
        if math.prod(image.size) > MOST_PIXELS:
            raise ShapeError(path.name, image.size, f"at most {MOST_PIXELS} pixels")
        if image.format == "TIFF" and image.mode == "I":  # any range; other files have 16 bits in this mode
            raise ValueError("pixels have 32 bits: save the picture with 8 bits per channel")
        yield image


def read_picture(path: Path, mode: str, wording: Wording) -> np.ndarray:
    """Read a picture as [rows, columns] (mode "L") or [rows, columns, 3] ("RGB") uint8.

    Raises:
        InputError: see `open_picture`.
    """
    with open_picture(path, wording) as image:
        return np.asarray(image.convert(mode))


def check_output(path: Path, folder: bool | None = False) -> None:
    """Check that a file can be written at `path`, or a folder, before work begins; leave nothing behind.

    Args:
        path: of the output; what is there already may be replaced.
        folder: whether it will be a folder; None: either.

    Raises:
        OutputError: something of another kind is there, or the system does not let its parent be written.
    """
    allowed = {False: ("file",), True: ("folder",), None: ("file", "folder")}[folder]
    try:
        if path.exists():
            there = "file" if path.is_file() else "folder" if path.is_dir() else "device"
            if there not in allowed:
                raise OutputError(path, f"a {there} is there, and the output is a {' or '.join(allowed)}")
        here = path.absolute()
        inside = here if here.is_dir() else next(above for above in here.parents if above.exists())
        tempfile.TemporaryDirectory(prefix=f".{path.name}.new-", dir=inside).cleanup()
    except OSError as cause:
        raise OutputError(path, cause.strerror or str(cause)) from cause


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Yield a temporary path to write to; it replaces `path` when the block ends without an error.

    Readers see the old file or the complete new one, also when the process is killed. Concurrent writers of
    one file have a temporary path each; the last one to finish wins. The folder of `path` is made if needed.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    folder, lock = _lock_folder(path)
    try:
        new = folder / path.name
        new.unlink(missing_ok=True)  # of a writer that was killed
        try:
            yield new
        except Exception as cause:
            if not (problem := _no_room(cause, new)):
                raise
            raise OutputError(path, problem, ROOM_REMEDY) from cause
        new.replace(path)
    finally:
        shutil.rmtree(folder, ignore_errors=True)  # it follows no link
        os.close(lock)


def _no_room(cause: Exception, new: Path) -> str:
    """What the system says about a disk that is full, if that is why writing failed; else nothing.

    Libraries say it in many ways, some not at all; then the unfinished file is asked for some more bytes.
    """
    said = re.search(r"\(os error (\d+)\)", str(cause))  # of libraries in Rust
    number = cause.errno if isinstance(cause, OSError) else int(said[1]) if said else None
    if number in NO_ROOM:
        return os.strerror(number)
    try:
        if new.exists():
            with new.open("r+b") as file:
                file.seek(0, os.SEEK_END)
                file.write(bytes(_LONGEST_LINE))
    except OSError as problem:
        return problem.strerror or str(problem)
    return ""


def _lock_folder(path: Path) -> tuple[Path, int]:
    """Make a folder beside a file, or take over that of a killed writer: the folder and its lock.

    The system releases the locks of killed processes. Whatever else has such a name is left alone: links,
    files, folders of other people and folders with other content.
    """
    for number in itertools.count():
        folder = path.with_name(f".{path.name}.new-{number}")
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        with suppress(FileNotFoundError, NotADirectoryError, PermissionError):  # gone, a link or not ours
            lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            with suppress(BlockingIOError, FileNotFoundError):
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if os.path.samestat(os.fstat(lock), folder.lstat()) and _is_writers(lock, path.name):
                    return folder, lock
            os.close(lock)
    raise AssertionError("itertools.count ends")


def _is_writers(folder: int, name: str) -> bool:
    """Whether a folder is one of this user's writers: it holds nothing but perhaps the unfinished file."""
    return os.listdir(folder) in ([], [name]) and os.fstat(folder).st_uid == os.geteuid()


def nameless() -> FileIO:
    """Open a scratch file without a name in `SCRATCH`; the system removes it when it is closed or by a kill.

    Where nothing may be written, it is in the system's temporary folder. It is not buffered, so that `write`
    reports a full disk, and no later call.

    Raises:
        OSError: the disk is full, or nothing may be written anywhere.
    """
    try:
        SCRATCH.mkdir(exist_ok=True)
        return tempfile.TemporaryFile(buffering=0, dir=SCRATCH)
    except OSError as cause:
        if cause.errno not in (errno.EROFS, errno.EACCES, errno.EPERM):
            raise
        return tempfile.TemporaryFile(buffering=0)


def write_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8) atomically; see `atomic_write`."""
    with atomic_write(path) as new:
        new.write_text(text, encoding="utf-8")


def write_json(path: Path, content: object) -> None:
    """Write JSON atomically, one value per line, in the given order; see `atomic_write`."""
    write_text(path, json.dumps(content, indent=1) + "\n")
