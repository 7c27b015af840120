"""Raw files from the first mirror that has all of them, unaltered.

A mirror is a folder or a tar archive, on this machine or at an https address. Its files are copied beside the
target, compared with the SHA-256 sums of the data set, and only then moved into place.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
import shutil
import tarfile
import tempfile
import urllib.request
import zlib
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from http.client import HTTPException
from pathlib import Path, PurePosixPath
from typing import IO, Any, cast

from tqdm import tqdm

from pedpred.errors import FetchError, ValueRuleError

_LARGEST_FILE_BYTES = 2**24
_SCHEMES = ("https://", "file://")
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Mirrors:
    """Where the files of a data set are, and what they must be.

    Attributes:
        data_set: its name.
        folders: mirrors tried first.
        archives: mirrors tried afterwards, paths or addresses.
        timeout_s: longest silence of a server, s.
        sums: SHA-256 sum of each file by its path inside the data set.
        optional: file names that a mirror may lack.
    """

    data_set: str
    folders: tuple[str, ...]
    archives: tuple[str, ...]
    timeout_s: float
    sums: Mapping[str, str]
    optional: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        for name, digest in self.sums.items():
            if not re.fullmatch("[0-9a-f]{64}", digest):
                raise ValueRuleError("sha256sums", f"{digest}  {name}", "a sum has 64 hexadecimal digits")

    @classmethod
    def parse(cls, data_set: str, plain: Mapping[str, Any]) -> Mirrors:
        """Build from a plain dictionary whose `sha256sums` are lines as `sha256sum` prints them."""
        lines = (line.split(maxsplit=1) for line in plain["sha256sums"])
        sums = {name: digest for digest, name in lines}
        folders, archives = tuple(plain["folders"]), tuple(plain["archives"])
        return cls(data_set, folders, archives, plain["timeout_s"], sums, frozenset(plain["optional"]))

    @property
    def required(self) -> list[str]:
        """The files that every mirror must have."""
        return sorted(name for name in self.sums if PurePosixPath(name).name not in self.optional)


def fetch(mirrors: Mirrors, target: Path) -> None:
    """Make the folder `target` hold the raw files of a data set; do nothing if it does already.

    Raises:
        ValueRuleError: the address of a mirror is not https.
        FetchError: no mirror has all files; the message names what each one lacks.
    """
    if lack(target, mirrors) is None:
        _log.info("%s is complete", target)
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    tried: dict[str, str] = {}
    for place in places(mirrors.folders, mirrors.archives):
        with tempfile.TemporaryDirectory(prefix=f".{target.name}-", dir=target.parent) as scratch:
            copy = Path(scratch, "new")
            problem = _collect(place, mirrors.sums, copy, mirrors.timeout_s) or lack(copy, mirrors)
            if problem is None:
                if target.exists():
                    target.rename(Path(scratch, "old"))
                copy.rename(target)
                _log.info("%s comes from %s", target, place)
                return
        _log.warning("%s skipped: %s", place, problem)
        tried[place] = problem
    raise FetchError(mirrors.data_set, mirrors.required, tried)


def places(folders: Iterable[str], archives: Iterable[str]) -> list[str]:
    """Return all mirrors in the order in which they are tried, $PEDPRED_MIRROR first.

    Relative paths start at the current folder and, because queued experiments run in a copy of the
    project, at $DVC_ROOT.

    Raises:
        ValueRuleError: an address is neither https nor file; others do not protect what they transfer.
    """
    found: dict[str, None] = {}
    for place in (os.environ.get("PEDPRED_MIRROR"), *folders, *archives):
        if place and place.startswith(_SCHEMES):
            found[place] = None
        elif place and "://" in place:
            raise ValueRuleError("archives", place, "use an address with https:// or file://")
        elif place:
            for root in (".", os.environ.get("DVC_ROOT", ".")):
                found[os.path.abspath(Path(root, place).expanduser())] = None
    return list(found)


def lack(folder: Path, mirrors: Mirrors) -> str | None:
    """Describe the first thing that is wrong with the files in a folder; None if nothing is."""
    problems = []
    for name, expected in mirrors.sums.items():
        path = folder / name
        if path.is_file():
            actual = hashlib.sha256(path.read_bytes()).hexdigest()
            if actual != expected:
                problems.append(f"{name} has SHA-256 {actual}, expected {expected}")
        elif name in mirrors.required:
            problems.append(f"{name} is missing")
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return problems[0] + more if problems else None


def _collect(place: str, names: Collection[str], copy: Path, timeout_s: float) -> str | None:
    """Copy the named files that a mirror has; return what prevented it, None if nothing did."""
    try:
        if place.startswith(_SCHEMES):
            with urllib.request.urlopen(place, timeout=timeout_s) as response:
                if not response.url.startswith(_SCHEMES):
                    return f"it redirects to {response.url}, which is not https"
                _unpack(response, int(response.headers["Content-Length"] or 0), names, copy)
        elif Path(place).is_file():
            with Path(place).open("rb") as archive:
                _unpack(archive, Path(place).stat().st_size, names, copy)
        elif Path(place).is_dir():
            for name in names:
                if Path(place, name).is_file():
                    (copy / name).parent.mkdir(parents=True, exist_ok=True)
                    shutil.copyfile(Path(place, name), copy / name)
        else:
            return "it does not exist"
    except (OSError, ValueError, EOFError, HTTPException, tarfile.TarError, zlib.error) as cause:
        return f"{type(cause).__name__}: {cause}"
    return None


def _unpack(stream: IO[bytes], size_bytes: int, names: Collection[str], copy: Path) -> None:
    """Copy the named files out of a tar stream, whatever folder they are in.

    A member is written under the requested name or not at all; paths in the archive are not used.

    Raises:
        tarfile.ExtractError: a member with an expected name is a link, leads outside or is huge.
    """
    with (
        tqdm.wrapattr(stream, "read", total=size_bytes or None, desc="fetch", disable=None) as counted,
        tarfile.open(fileobj=cast(IO[bytes], counted), mode="r|*") as archive,
    ):
        for member in archive:
            path = PurePosixPath(member.name)
            name = "/".join(path.parts[-2:])
            if name not in names:
                continue
            if not member.isreg() or path.is_absolute() or ".." in path.parts:
                raise tarfile.ExtractError(f"member {member.name} is no plain file inside the archive")
            if member.size > _LARGEST_FILE_BYTES:
                raise tarfile.ExtractError(f"member {member.name} has {member.size} bytes")
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            with (copy / name).open("wb") as file:
                shutil.copyfileobj(cast(IO[bytes], archive.extractfile(member)), file)
