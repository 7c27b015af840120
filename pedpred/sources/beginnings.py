"""What a file begins with: by this, and not by its name, the formats of single files are told apart."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

from pedpred.errors import SourceError
from pedpred.files import translate_errors
from pedpred.tables.encodings import UTF_16

_LOOKED_AT_BYTES = 2**16
_PAIRS = 16  # bytes of which each second one is 0 in UTF-16
_MOTION_CAPTURE = (
    (re.compile(rb"(\xef\xbb\xbf)?Format Version,[\d.]+,"), "Motive (OptiTrack)"),
    (re.compile(rb"(\xef\xbb\xbf)?[A-Z][\w ]+[,\t]*\r?\n[\d.]+[,\t]*\r?\n[,\t]{2}"), "Nexus (Vicon)"),
)
"""How exports begin whose titles are distributed over several lines, and who writes them."""
_PER_BODY = (
    "Write a line per body and instant, with the columns time,id,x,y (x and y: the axes of the ground)"
)
_TAR_AT, _TAR = 257, b"ustar"
_JSON = re.compile(rb'(\xef\xbb\xbf)?\s*(\{\s*["}]|\[\s*[\[{"])')
NO_PEDESTRIAN = "Only pedestrians are read: name a recording with some"
"""What to do where a file is right, and nobody in it is a pedestrian."""
_TABLE = "Save it as CSV with the columns time,id,x,y"
_OTHERS = {
    (b"\x1f\x8b",): ("a gzip archive", "Unpack it"),
    (b"PK\x03\x04",): ("a zip archive or a spreadsheet", "Unpack it, or save the table as CSV"),
    (b"BZh",): ("a bzip2 archive", "Unpack it"),
    (b"\xfd7zXZ\x00",): ("an xz archive", "Unpack it"),
    (b"\x28\xb5\x2f\xfd",): ("a Zstandard archive", "Unpack it"),
    (b"#ROSBAG V",): ("a bag of ROS 1", "Give it a name that ends in .bag"),
    (b"\x93NUMPY",): ("an array of NumPy", _TABLE),
    (b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05"): (
        "a pickle of Python",
        f"{_TABLE}; pickles are not opened",
    ),
    (b"\xd0\xcf\x11\xe0",): ("a spreadsheet of Excel", "Save the table as CSV"),
    (b"version https://git-lfs",): ("a pointer of Git LFS in place of the file", "Fetch it: git lfs pull"),
    (b"<!doctype html", b"<!DOCTYPE html", b"<html"): ("a web page", "Download the file that it links"),
    (b"MATLAB",): ("a file of MATLAB", _TABLE),
    (b"%PDF",): ("a PDF document", "Name the table of tracks"),
    (b"\x89PNG", b"P5", b"\xff\xd8\xff"): ("a picture", "Name the table of tracks; pictures are for --map"),
}
"""How files begin that are not tracks: what they are, and what to do."""


@dataclass(frozen=True)
class Beginning:
    """The first bytes of a file.

    Attributes:
        path: of the file.
        raw: its first 64 KiB.
    """

    path: Path
    raw: bytes

    @classmethod
    def of(cls, path: Path) -> Beginning:
        """Read it.

        Raises:
            SourceError: the file is missing or cannot be opened.
        """
        if not path.exists():
            raise SourceError(path, None, "the file is missing")
        with translate_errors(partial(SourceError, path, None)), path.open("rb") as file:
            return cls(path, file.read(_LOOKED_AT_BYTES))

    @cached_property
    def lines(self) -> Sequence[str]:
        """The lines that are not blank, without the last one if the file goes on; none of binary files."""
        if b"\0" in self.raw and not self._is_utf_16:
            return ()
        encoding = "utf-16" if self._is_utf_16 else "utf-8-sig"
        lines = self.raw.decode(encoding, errors="replace").splitlines()
        whole = lines[:-1] if len(self.raw) == _LOOKED_AT_BYTES else lines
        return [line for line in whole if line.strip()]

    @property
    def _is_utf_16(self) -> bool:
        return self.raw.startswith(UTF_16)

    def line(self) -> str:
        """The first line that is not a comment; empty where there is none."""
        return next((line for line in self.lines if not line.startswith("#")), "")

    def foreign(self) -> SourceError | None:
        """The error that names what a file is, if it can be no table; else None."""
        for magics, (what, remedy) in _OTHERS.items():
            if self.raw.startswith(magics):
                return SourceError(self.path, None, f"this is {what}, which is not read", remedy)
        if self.raw[_TAR_AT:].startswith(_TAR):
            return SourceError(self.path, None, "this is a tar archive, which is not read", "Unpack it")
        for begins, program in _MOTION_CAPTURE:
            if begins.match(self.raw):
                return SourceError(
                    self.path, None, f"this is an export of {program}, which is not read", _PER_BODY
                )
        if self.line().lstrip().startswith("<"):
            match = re.search(r"<([A-Za-z][\w.-]*)", "\n".join(self.lines))
            problem = f"this is XML whose outermost element is <{match[1][:80] if match else ''}>"
            return SourceError(
                self.path, None, problem, "Of XML, FCD of SUMO is read; geometries are for --map"
            )
        if _JSON.match(self.raw):
            return SourceError(self.path, None, "this is JSON of a kind that is not read", _TABLE)
        if b"\0" not in self.raw or self._is_utf_16:
            return None
        if any(set(self.raw[first:_PAIRS:2]) == {0} for first in (0, 1)):
            return SourceError(
                self.path, None, "this is UTF-16 without a mark, which is not read", "Save it as UTF-8"
            )
        problem = f"neither text nor a known recording; it begins with the bytes {self.raw[:8].hex(' ')}"
        return SourceError(self.path, None, problem, "Convert it to a table with the columns time,id,x,y")
