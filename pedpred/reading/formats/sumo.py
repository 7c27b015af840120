"""Floating car data of SUMO (`--fcd-output`): the `<person>` elements of each `<timestep>`.

    <fcd-export> <timestep time="0.00"> <person id="p0" x="1.20" y="3.40" speed="1.30" .../> ...

Vehicles, and people in vehicles, are passed over.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from pathlib import Path
from xml.parsers import expat

import numpy as np
import pyarrow as pa

from pedpred.errors import brief
from pedpred.reading.errors import CORRECT, NO_DOCTYPE, NO_PEDESTRIAN, ContentError
from pedpred.reading.head import Head
from pedpred.reading.options import ReadOptions
from pedpred.reading.table import Table
from pedpred.reading.text import check_size, finite_number

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
            reading.parser.Parse(chunk)
            if (fed := fed + len(chunk)) - reading.parser.CurrentByteIndex > _LONGEST_ELEMENT_BYTES:
                raise reading.problem(f"an element of more than {_LONGEST_ELEMENT_BYTES} bytes")
        reading.parser.Parse(b"", True)
    if not reading.ids:
        raise ContentError("no <person> walks in any <timestep>", NO_PEDESTRIAN)
    values = np.frombuffer(reading.values).reshape(-1, 3)
    _check_metres(np.array(reading.ids), values[:, 1:])
    ids = pa.DictionaryArray.from_arrays(pa.array(reading.ids), pa.array(list(reading.number_of)))
    columns = dict(zip(("time", "x", "y"), values.T.copy(), strict=True))
    return Table(pa.table({"id": ids} | columns), "m")


def _check_metres(track_id: np.ndarray, position: np.ndarray) -> None:
    """Check that positions [M, 2] are no degrees: people walk farther than `_SMALLEST_STEP` in a step."""
    order = np.argsort(track_id, kind="stable")
    steps = np.abs(np.diff(position[order], axis=0)[np.diff(track_id[order]) == 0])
    if (np.abs(position) <= (180, 90)).all() and 0 < steps.max(initial=0) < _SMALLEST_STEP:
        remedy = "Write metres: run SUMO without --fcd-output.geo"
        raise ContentError("positions look like degrees of longitude and latitude", remedy)


class _Reading:
    """Handlers of the XML parser, and what they have read: ids, and `time`, `x`, `y` of each person."""

    def __init__(self) -> None:
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler, self.parser.EndElementHandler = self.start, self.end
        self.parser.StartDoctypeDeclHandler = self.doctype
        self.depth, self.time = 0, ""
        self.values, self.ids = array("d"), array("i")
        self.number_of: dict[str, int] = {}

    def problem(self, text: str, remedy: str = CORRECT) -> ContentError:
        """An error in the present line."""
        return ContentError(text, remedy, self.parser.CurrentLineNumber)

    def doctype(self, *_: object) -> None:
        raise self.problem(*NO_DOCTYPE)

    def start(self, name: str, attributes: Mapping[str, str]) -> None:
        self.depth += 1
        if self.depth > _DEEPEST:
            raise self.problem(f"elements more than {_DEEPEST} deep")
        if name == "timestep":
            self.time = attributes.get("time", "")
        elif name == "person" and not attributes.get("vehicle"):
            self.person({"id": "", "x": "", "y": "", **attributes, "time": self.time})

    def person(self, attributes: Mapping[str, str]) -> None:
        if not attributes["id"]:
            raise self.problem("a <person> has no id")
        for key in ("time", "x", "y"):
            try:
                self.values.append(finite_number(attributes[key]))
            except ValueError as cause:
                raise self.problem(f"{key} = {brief(attributes[key])}, must be a finite number") from cause
        self.ids.append(self.number_of.setdefault(attributes["id"], len(self.number_of)))
        check_size(len(self.ids))

    def end(self, name: str) -> None:
        self.depth -= 1
