"""Floating car data of SUMO (`--fcd-output`): the `<person>` elements of each `<timestep>`.

    <fcd-export> <timestep time="0.00"> <person id="p0" x="1.20" y="3.40" speed="1.30" .../> ...

Vehicles, and people in vehicles, are passed over.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa

from pedpred.reading.errors import NO_PEDESTRIAN, ContentError
from pedpred.reading.head import Head
from pedpred.reading.options import ReadOptions
from pedpred.reading.table import Table
from pedpred.reading.text import to_number
from pedpred.reading.xml_parser import XmlParser
from pedpred.storage.tracks import MOST_NUMBERS

NAME = "SUMO FCD"
_CHUNK_BYTES, _LONGEST_ELEMENT_BYTES, _DEEPEST = 2**16, 2**20, 8
_SMALLEST_STEP = 1e-3
"""People who walk move farther than this between two steps, if positions are metres."""


def recognises(head: Head) -> bool:
    """Whether a file is XML with floating car data."""
    return head.line.lstrip().startswith("<") and any("<fcd-export" in line for line in head.lines)


def read(path: Path, options: ReadOptions) -> Table:
    """Read the people, element by element.

    Raises:
        ContentError: the file is damaged, has no people, or its positions are degrees.
    """
    reading = _Reading()
    with path.open("rb") as file:
        fed = 0
        while chunk := file.read(_CHUNK_BYTES):
            fed += len(chunk)
            if fed - reading.parser.feed(chunk) > _LONGEST_ELEMENT_BYTES:
                raise reading.parser.problem(f"an element of more than {_LONGEST_ELEMENT_BYTES} bytes")
        reading.parser.feed(b"", final=True)
    if not reading.ids:
        raise ContentError("no <person> walks in any <timestep>", NO_PEDESTRIAN)
    numbers = np.frombuffer(reading.numbers).reshape(-1, 3)
    steps = np.diff(numbers[np.argsort(reading.ids, kind="stable"), 1:], axis=0)
    if (np.abs(numbers[:, 1:]) <= (180, 90)).all() and steps.any():
        same = np.diff(np.sort(reading.ids)) == 0
        if same.any() and 0 < np.abs(steps[same]).max() < _SMALLEST_STEP:
            remedy = "Write metres: run SUMO without --fcd-output.geo"
            raise ContentError("positions look like degrees of longitude and latitude", remedy)
    ids = pa.DictionaryArray.from_arrays(pa.array(reading.ids), pa.array(list(reading.number_of)))
    columns = dict(zip(("time", "x", "y"), numbers.T.copy(), strict=True))
    return Table(pa.table({"id": ids, **{name: pa.array(values) for name, values in columns.items()}}), "m")


class _Reading:
    """Handlers of the XML parser, and what they have read: ids, and `time`, `x`, `y` of each person."""

    def __init__(self) -> None:
        self.parser = XmlParser("fcd-export", self.start, self.end)
        self.depth, self.time = 0, ""
        self.numbers, self.ids = array("d"), array("i")
        self.number_of: dict[str, int] = {}

    def start(self, name: str, attributes: Mapping[str, str]) -> None:
        self.depth += 1
        if self.depth > _DEEPEST:
            raise self.parser.problem(f"elements more than {_DEEPEST} deep")
        if name == "timestep":
            self.time = attributes.get("time", "")
        elif name == "person" and not attributes.get("vehicle"):
            self.person(attributes)

    def person(self, attributes: Mapping[str, str]) -> None:
        if not (who := attributes.get("id", "")):
            raise self.parser.problem("a <person> has no id")
        written = {"time": self.time, "x": attributes.get("x", ""), "y": attributes.get("y", "")}
        for key, text in written.items():
            try:
                value = to_number(text)
            except ValueError as cause:
                raise self.parser.problem(f"{key} = {text[:80]!r} is not a number") from cause
            if not np.isfinite(value):
                raise self.parser.problem(f"{key} = {text[:80]}, must be finite")
            self.numbers.append(value)
        self.ids.append(self.number_of.setdefault(who, len(self.number_of)))
        if 4 * len(self.ids) > MOST_NUMBERS:
            raise ContentError(f"more than {MOST_NUMBERS // 4} detections", "Divide the file")

    def end(self, name: str) -> None:
        self.depth -= 1
