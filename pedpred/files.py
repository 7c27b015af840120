"""Files on disk, as safely as they can be had: foreign ones are read within bounds, ours are written whole.

Reading: `translate_errors` turns what a decoder raises on damaged bytes into an error that names the file;
`read_bytes`, `read_json`, `read_yaml` and `read_picture` are bounded in size.
Writing: `atomic_write` lets a file appear under its name only when it is complete; scratch data go to a file
that is `nameless`.
"""

from __future__ import annotations

import json
import math
import os
import secrets
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import FileIO
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from PIL import Image

from pedpred.errors import FileError, PedpredError, ShapeError

MOST_PIXELS = 2**26
"""Of a picture or a map: 400 m x 400 m in cells of 5 cm."""

SCRATCH = Path("build")
"""On the project's disk: where a system keeps temporary files is often its memory."""

_LARGEST_BYTES = 2**30
_LARGEST_JSON_BYTES = 2**22
_LARGEST_YAML_BYTES = 2**18
_LONGEST_PROBLEM = 600
_PICTURES = ("PNG", "PPM", "BMP", "JPEG")  # formats that are decoded here, not by another program

Wording = Callable[[str], PedpredError]
"""Makes the error of a problem: it knows the file and the remedy."""


@contextmanager
def translate_errors(wording: Wording) -> Iterator[None]:
    """Say whatever goes wrong inside as an error that names the file; the cause is chained.

    Decoders of foreign bytes document no complete list of what they raise, so that any `Exception` counts;
    an error that names a file already passes.

    Args:
        wording: such as `partial(StorageError, path, "file", remedy=...)`.
    """
    try:
        yield
    except FileError:
        raise
    except Exception as cause:
        raise wording(" ".join(_problem(cause).split())[:_LONGEST_PROBLEM]) from cause


def _problem(cause: Exception) -> str:
    if isinstance(cause, KeyError):
        return f"{cause} is missing"
    return str(cause) if isinstance(cause, PedpredError) else f"{type(cause).__name__}: {cause}"


def read_bytes(path: Path, largest: int = _LARGEST_BYTES) -> bytes:
    """The bytes of a file that has at most `largest` of them.

    Raises:
        OSError: the file cannot be read.
        ShapeError: it is larger.
    """
    size = path.stat().st_size
    if size > largest:
        raise ShapeError("file", (size,), f"at most {largest} bytes")
    with path.open("rb") as file:
        return file.read(size)


def read_json(path: Path, wording: Wording) -> dict[str, Any]:
    """The object in a JSON file.

    Args:
        path: the file.
        wording: of the error, see `translate_errors`.

    Raises:
        FileError: the file is missing, too large, no JSON or holds another thing than an object.
    """
    with translate_errors(wording):
        return _mapping(json.loads(read_bytes(path, _LARGEST_JSON_BYTES)))


def read_yaml(path: Path, wording: Wording) -> dict[str, Any]:
    """The mapping in a YAML file; arguments and errors of `read_json`. No tag makes an object."""
    with translate_errors(wording):
        return _mapping(yaml.safe_load(read_bytes(path, _LARGEST_YAML_BYTES)))


def _mapping(content: Any) -> dict[str, Any]:
    if not isinstance(content, dict):
        raise TypeError(f"{type(content).__name__}, expected an object")
    return content


def read_picture(path: Path, mode: str, wording: Wording) -> np.ndarray:
    """A picture as [rows, columns] (mode "L") or [rows, columns, 3] ("RGB") uint8.

    Its size is looked at before a pixel is decoded.

    Raises:
        FileError: the file is missing, no picture, damaged or has more than `MOST_PIXELS`.
    """
    with translate_errors(wording), Image.open(path, formats=_PICTURES) as image:
        if math.prod(image.size) > MOST_PIXELS:
            raise ShapeError(path.name, image.size, f"at most {MOST_PIXELS} pixels")
        return np.asarray(image.convert(mode))


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """A path beside `path` to write to; what was written takes the place of `path` when the block ends well.

    Both are in one folder, so that taking the place is one step of the file system: whoever is killed in the
    middle leaves the old file or none, never half of one. The folder is made if it is not there.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_name(f".new-{os.getpid()}-{secrets.token_hex(4)}-{path.name}")
    try:
        yield new
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)


def nameless() -> FileIO:
    """A file to write and read in `SCRATCH` that ends with its last user: a kill -9 leaves nothing behind.

    It is not buffered, so that a full disk is told by `write` and never later.

    Raises:
        OSError: the folder cannot be made or written to.
    """
    SCRATCH.mkdir(exist_ok=True)
    return tempfile.TemporaryFile(buffering=0, dir=SCRATCH)


def write_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8) as a whole; see `atomic_write`."""
    with atomic_write(path) as new:
        new.write_text(text, encoding="utf-8")


def write_json(path: Path, content: object) -> None:
    """Write JSON as a whole, one value per line, in the given order; see `atomic_write`."""
    write_text(path, json.dumps(content, indent=1) + "\n")
