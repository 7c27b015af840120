"""Raw files, each from the first mirror that has it unaltered.

A mirror is a folder or a tar archive, on this machine or at an https address. Its files are copied beside the
target, compared with the SHA-256 sums of the data set, and moved into place when all are there.

A folder may hold archives as downloaded beside, or in place of, the files. Files that no mirror has are no
failure: a note takes their place, and the places that need them become scenes without people. Files that are
not what they must be are one.
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
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from http.client import HTTPException
from pathlib import Path, PurePosixPath
from typing import Annotated, Any

from pedpred.errors import FetchError, ValueRuleError
from pedpred.settings import In, Settings, check_mapping, load
from pedpred.sources.archives import unpack_members

_SCHEMES = ("https://", "file://")
_FAILURES = (OSError, ValueError, EOFError, RecursionError, HTTPException, tarfile.TarError, zlib.error)
_ARCHIVES = ("*.tar", "*.tar.gz", "*.tgz")
_SUM = re.compile(r"[0-9a-f]{64}\s+\S.*")
_log = logging.getLogger(__name__)

NOTE = "UNAVAILABLE.txt"
"""In place of raw files that no mirror has: what is missing and what to do."""


@dataclass(frozen=True)
class Mirrors(Settings):
    """Where the files of a data set are, and what they must be.

    Attributes:
        data_set: its name.
        folders: mirrors tried first.
        archives: mirrors tried afterwards, paths or addresses.
        timeout_s: longest silence of a server, s.
        sha256sums: lines as `sha256sum` prints them, with the path of a file inside the data set.
        optional: file names that a mirror may lack.
        inside: where a file is in archives, if that is not its path inside the data set.
    """

    data_set: str
    folders: tuple[str, ...]
    archives: tuple[str, ...]
    timeout_s: Annotated[float, In("(0, 3600]")]
    sha256sums: tuple[str, ...]
    optional: tuple[str, ...] = ()
    inside: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        for line in self.sha256sums:
            if not _SUM.fullmatch(line):
                rule = "a line holds a sum of 64 hexadecimal digits and the path of a file"
                raise ValueRuleError("sha256sums", line, rule)
        if strangers := sorted(set(self.inside) - set(self.sums)):
            raise ValueRuleError("inside", strangers, "these files have no line in sha256sums")

    @classmethod
    def parse(cls, data_set: str, plain: Mapping[str, Any]) -> Mirrors:
        """Build from a plain dictionary of the other fields.

        Raises:
            ValueRuleError: a field is missing or unknown, or breaks its rule.
        """
        check_mapping(data_set, plain)
        return load(cls, {**plain, "data_set": data_set})

    @cached_property
    def sums(self) -> dict[str, str]:
        """The SHA-256 sum of each file."""
        return {name: digest for digest, name in (line.split(maxsplit=1) for line in self.sha256sums)}

    @property
    def required(self) -> list[str]:
        """The files that every mirror must have."""
        return sorted(name for name in self.sums if PurePosixPath(name).name not in self.optional)

    @property
    def advice(self) -> str:
        """Say in one line how to get the files."""
        addresses = ", ".join(place for place in self.archives if "://" in place)
        archives = f" ({addresses})" if addresses else ""
        return (
            f"no raw data of {self.data_set}: put archives that hold them{archives}, as downloaded, or the "
            f"files into the folder mirror/{self.data_set}, or name such a folder, or one that holds it as "
            f"{self.data_set}: PEDPRED_MIRROR=/my/folder"
        )


def provide(mirrors: Mirrors, target: Path) -> None:
    """Fetch the files; if no mirror has them all, leave a note in each of their folders in `target`.

    Raises:
        FetchError: a mirror has a file whose content differs.
    """
    try:
        fetch(mirrors, target)
    except FetchError as error:
        if error.damaged:
            raise
        note = f"{mirrors.advice}\n{error} Until then its places are empty. `make reproduce` tries again."
        with tempfile.TemporaryDirectory(prefix=f".{target.name}-", dir=target.parent) as scratch:
            for folder in {PurePosixPath(name).parent for name in (NOTE, *mirrors.sums)}:
                new = Path(scratch, "new", folder, NOTE)
                new.parent.mkdir(parents=True, exist_ok=True)
                new.write_text(f"{note}\n")
            _move_into_place(Path(scratch, "new"), target)
        _log.warning("%s", note)


def fetch(mirrors: Mirrors, target: Path) -> None:
    """Make the folder `target` hold the raw files of a data set; do nothing if it does already.

    Raises:
        ValueRuleError: the address of a mirror is not https.
        FetchError: some file is nowhere; the message names what each mirror lacks.
    """
    if lack(target, mirrors) is None:
        _log.info("%s is complete", target)
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    tried: dict[str, str] = {}
    damaged = False
    present = [str(target)] if target.exists() and not (target / NOTE).exists() else []
    with tempfile.TemporaryDirectory(prefix=f".{target.name}-", dir=target.parent) as scratch:
        copy = Path(scratch, "new")
        for place in [*present, *places(mirrors.data_set, mirrors.folders, mirrors.archives)]:
            try:
                _collect(place, mirrors, copy)
                problem = lack(copy, mirrors)
            except _FAILURES as cause:
                problem = f"{type(cause).__name__}: {cause}"
            if problem is None:
                _move_into_place(copy, target)
                _log.info("%s comes from %s", target, place)
                return
            _log.warning("%s skipped: %s", place, problem)
            tried[place] = problem
            for name in _find_altered(copy, mirrors.sums):
                damaged = True
                (copy / name).unlink()
    raise FetchError(mirrors.data_set, mirrors.required, tried, damaged)


def _move_into_place(new: Path, target: Path) -> None:
    """Move a folder into the place of another one, which goes to the scratch folder that `new` is in."""
    if target.exists():
        target.rename(new.with_name("old"))
    new.rename(target)


def places(data_set: str, folders: Iterable[str], archives: Iterable[str]) -> list[str]:
    """Return all mirrors in the order in which they are tried, $PEDPRED_MIRROR first.

    That folder may hold one data set, or several in folders of their names. Relative paths start at the
    current folder and, because queued experiments run in a copy of the project, at $DVC_ROOT.

    Raises:
        ValueRuleError: an address is neither https nor file; others do not protect what they transfer.
    """
    named: dict[str, None] = {}
    own = os.environ.get("PEDPRED_MIRROR")
    inside = os.path.join(own, data_set) if own and "://" not in own else None
    for place in filter(None, (own, inside, *folders, *archives)):
        if place.startswith(_SCHEMES):
            named[place] = None
        elif "://" in place:
            raise ValueRuleError("archives", place, "use an address with https:// or file://")
        else:
            for root in (".", os.environ.get("DVC_ROOT", ".")):
                path = os.path.abspath(Path(root, place).expanduser())
                if place != inside or os.path.isdir(path):
                    named[path] = None
    return list(named)


def lack(folder: Path, mirrors: Mirrors) -> str | None:
    """Describe the first thing that is wrong with the files in a folder; None if nothing is."""
    missing = [f"{name} is missing" for name in mirrors.required if not (folder / name).is_file()]
    problems = [*_find_altered(folder, mirrors.sums).values(), *missing]
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return problems[0] + more if problems else None


def _find_altered(folder: Path, sums: Mapping[str, str]) -> dict[str, str]:
    """Name the files in a folder whose sum is another one, and describe each."""
    problems = {}
    for name, expected in sums.items():
        path = folder / name
        if path.is_file() and (actual := hashlib.sha256(path.read_bytes()).hexdigest()) != expected:
            problems[name] = f"{name} has SHA-256 {actual}, expected {expected}"
    return problems


def _collect(place: str, mirrors: Mirrors, copy: Path) -> None:
    """Copy the files that a mirror has, and that are not yet there, to a folder.

    Raises:
        OSError, ValueError and others of `_FAILURES`: it does not exist, or is damaged.
    """
    if place.startswith(_SCHEMES):
        with urllib.request.urlopen(place, timeout=mirrors.timeout_s) as response:
            if not response.url.startswith(_SCHEMES):
                raise ValueError(f"it redirects to {response.url}, which is not https")
            size = int(response.headers["Content-Length"] or 0)
            unpack_members(response, size, _still_missing(mirrors, copy), copy)
        return
    folder = Path(place)
    archives = [path for ending in _ARCHIVES for path in folder.glob(ending)] if folder.is_dir() else [folder]
    for name in _still_missing(mirrors, copy):
        if (folder / name).is_file():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(folder / name, copy / name)
    for path in sorted(archives):
        with path.open("rb") as archive:
            unpack_members(archive, path.stat().st_size, _still_missing(mirrors, copy), copy)


def _still_missing(mirrors: Mirrors, copy: Path) -> dict[str, str]:
    """The files that are not yet in a folder, and where each is in archives."""
    return {name: mirrors.inside.get(name, name) for name in mirrors.sums if not (copy / name).exists()}
