"""Recognise the format of a file by its first bytes, and name what is not read."""

from __future__ import annotations

import gzip
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from pedpred.reading.errors import ContentError

GZIP = b"\x1f\x8b"
UTF_16 = (b"\xff\xfe", b"\xfe\xff")
_BYTES = 2**16
_TABLE = "Save it as CSV with the columns time,id,x,y"
_MOTION_CAPTURE = "Write a line per body and instant, with the columns time,id,x,y (x, y: axes of the ground)"
_OTHERS = (
    (rb"PK\x03\x04", "a zip archive or a spreadsheet", "Unpack it, or save the table as CSV"),
    (rb"BZh|\xfd7zXZ\x00|\x28\xb5\x2f\xfd|[\s\S]{257}ustar", "an archive", "Unpack it"),
    (rb"#ROSBAG V", "a bag of ROS 1", "Give it a name that ends in .bag"),
    (rb"\x93NUMPY", "an array of NumPy", _TABLE),
    (rb"\x80[\x02-\x05]", "a pickle of Python", f"{_TABLE}; pickles are not opened"),
    (rb"\xd0\xcf\x11\xe0", "a spreadsheet of Excel", "Save the table as CSV"),
    (rb"version https://git-lfs", "a pointer of Git LFS in place of the file", "Fetch it: git lfs pull"),
    (rb"(?i:<!doctype html|<html)", "a web page", "Download the file that it links"),
    (rb"MATLAB", "a file of MATLAB", _TABLE),
    (rb"%PDF", "a PDF document", "Name the table of tracks"),
    (rb"\x89PNG|P5|\xff\xd8\xff", "a picture", "Name the table of tracks; pictures are for --map"),
    (rb"(\xef\xbb\xbf)?Format Version,[\d.]+,", "an export of Motive (OptiTrack)", _MOTION_CAPTURE),
    (
        rb"(\xef\xbb\xbf)?[A-Z][\w ]+[,\t]*\r?\n[\d.]+[,\t]*\r?\n[,\t]{2}",
        "an export of Nexus (Vicon)",
        _MOTION_CAPTURE,
    ),
    (rb'(\xef\xbb\xbf)?\s*(\{\s*["}]|\[\s*[\[{"])', "JSON of a kind", _TABLE),
)
"""How files begin that are not tracks, what they are, and what to do."""


@dataclass(frozen=True)
class Head:
    """The first bytes of a file, unpacked if it is compressed with gzip. [at most 64 KiB]."""

    raw: bytes

    @classmethod
    def of(cls, path: Path) -> Head:
        """Read the first bytes of a file."""
        with path.open("rb") as file:
            raw = file.read(_BYTES)
        if raw.startswith(GZIP):
            with gzip.open(path) as unpacked:
                raw = unpacked.read(_BYTES)
        return cls(raw)

    @cached_property
    def lines(self) -> Sequence[str]:
        """The lines that are not blank, without the last one if the file goes on; none of binary files."""
        if b"\0" in self.raw and not self.raw.startswith(UTF_16):
            return ()
        encoding = "utf-16" if self.raw.startswith(UTF_16) else "utf-8-sig"
        lines = self.raw.decode(encoding, errors="replace").splitlines()
        whole = lines[:-1] if len(self.raw) == _BYTES else lines
        return [line for line in whole if line.strip()]

    @property
    def line(self) -> str:
        """The first line that is not a comment; empty where there is none."""
        return next((line for line in self.lines if not line.startswith("#")), "")

    def check_text(self) -> None:
        """Check that the file may be a table.

        Raises:
            ContentError: it is something else, which is named.
        """
        for pattern, what, remedy in _OTHERS:
            if re.match(pattern, self.raw):
                raise ContentError(f"this is {what}, which is not read", remedy)
        if self.line.lstrip().startswith("<"):
            element = re.search(r"<([A-Za-z][\w.-]*)", "\n".join(self.lines))
            problem = f"this is XML whose outermost element is <{element[1][:80] if element else ''}>"
            raise ContentError(problem, "Of XML, FCD of SUMO is read; geometries are for --map")
        if self.raw and not self.lines and b"\0" in self.raw:
            begins = f"it begins with the bytes {self.raw[:8].hex(' ')}"
            raise ContentError(f"neither text nor a known recording; {begins}", _TABLE)
