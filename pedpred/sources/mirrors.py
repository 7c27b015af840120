"""Raw files from the first mirror that has them all, unaltered.

A mirror is a folder or a tar archive, on this machine or at an https address. What it offers is
copied beside the target, compared with the SHA-256 sums `<data set>.sha256` that lie next to this
module, and only then moved into place.
"""

from __future__ import annotations

import hashlib
import logging
import os
import shutil
import tarfile
import tempfile
import urllib.request
import zlib
from collections.abc import Collection, Iterable, Mapping
from http.client import HTTPException
from pathlib import Path, PurePosixPath
from typing import IO, cast

from tqdm import tqdm

from pedpred.errors import ConfigError, FetchError

OPTIONAL = frozenset({"reference.png"})
_LARGEST_FILE_BYTES = 2**24
_SCHEMES = ("https://", "file://")
_log = logging.getLogger(__name__)


def fetch(
    data_set: str,
    target: Path,
    folders: Iterable[str],
    archives: Iterable[str],
    timeout_s: float,
    sums: Mapping[str, str] | None = None,
) -> None:
    """Make `target` hold the raw files of a data set; nothing happens when it does already.

    Args:
        data_set: which one, `ewap`.
        target: folder to create or to replace.
        folders: mirrors tried first.
        archives: mirrors tried afterwards, paths or addresses.
        timeout_s: how long a server may keep silent, s.
        sums: SHA-256 sum of each file; the committed ones of the data set if none are given.

    Raises:
        ConfigError: a mirror's address is not one of https.
        FetchError: no mirror has all files; it says what each one lacks.
    """
    sums = checksums(data_set) if sums is None else sums
    if lack(target, sums) is None:
        _log.info("%s is complete", target)
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    tried: dict[str, str] = {}
    for place in places(folders, archives):
        with tempfile.TemporaryDirectory(prefix=f".{target.name}-", dir=target.parent) as scratch:
            copy = Path(scratch, "new")
            problem = _collect(place, sums, copy, timeout_s) or lack(copy, sums)
            if problem is None:
                if target.exists():
                    target.rename(Path(scratch, "old"))
                copy.rename(target)
                _log.info("%s comes from %s", target, place)
                return
        _log.warning("%s passed over: %s", place, problem)
        tried[place] = problem
    raise FetchError(data_set, sorted(name for name in sums if _required(name)), tried)


def checksums(data_set: str) -> dict[str, str]:
    """SHA-256 sum of each file of a data set, by its path inside the data set."""
    lines = Path(__file__).with_name(f"{data_set}.sha256").read_text().splitlines()
    return {name: digest for digest, name in (line.split() for line in lines)}


def places(folders: Iterable[str], archives: Iterable[str]) -> list[str]:
    """All mirrors in the order in which they are tried, $PEDPRED_MIRROR first.

    Relative paths start at the current folder and, because queued experiments run in a copy of the
    project, at $DVC_ROOT.

    Raises:
        ConfigError: an address is neither https nor file: on the way from there anybody may read and alter.
    """
    found: dict[str, None] = {}
    for place in (os.environ.get("PEDPRED_MIRROR"), *folders, *archives):
        if place and place.startswith(_SCHEMES):
            found[place] = None
        elif place and "://" in place:
            raise ConfigError("mirrors", place, "only addresses with https:// or file:// will do")
        elif place:
            for root in (".", os.environ.get("DVC_ROOT", ".")):
                found[os.path.abspath(Path(root, place).expanduser())] = None
    return list(found)


def lack(folder: Path, sums: Mapping[str, str]) -> str | None:
    """The first thing that is wrong with the files in a folder, None when they are as they should be."""
    problems = []
    for name, expected in sums.items():
        path = folder / name
        if path.is_file():
            actual = hashlib.sha256(path.read_bytes()).hexdigest()
            if actual != expected:
                problems.append(f"{name} has SHA-256 {actual}, expected {expected}")
        elif _required(name):
            problems.append(f"{name} is missing")
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return problems[0] + more if problems else None


def _required(name: str) -> bool:
    return PurePosixPath(name).name not in OPTIONAL


def _collect(place: str, names: Collection[str], copy: Path, timeout_s: float) -> str | None:
    """Copy the named files that a mirror has; return what prevented it, if anything did."""
    try:
        if place.startswith(_SCHEMES):
            with urllib.request.urlopen(place, timeout=timeout_s) as response:
                if not response.url.startswith(_SCHEMES):
                    return f"it leads to {response.url}, which is not https"
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
    """Copy the named files out of a tar stream, whatever folder they lie in.

    The archive decides about no path: a member is written under the name that was asked for, or
    not at all.

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
