"""Floating car data of SUMO (`--fcd-output`): the `<person>` elements of each `<timestep>`.

    <fcd-export> <timestep time="0.00"> <person id="p0" x="1.20" y="3.40" speed="1.30" .../> ...

Vehicles, and people in vehicles, are passed over.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from xml.parsers import expat

import numpy as np

from pedpred.errors import SourceError
from pedpred.files import translate_errors
from pedpred.scenes import Trajectories
from pedpred.sources.beginnings import NO_PEDESTRIAN, Beginning
from pedpred.tables.options import TableOptions
from pedpred.tables.reading import tracks_in_rows
from pedpred.tables.text import Row

_COLUMNS = ("time", "id", "x", "y")
_CHUNK_BYTES, _LONGEST_ELEMENT_BYTES, _DEEPEST = 2**16, 2**20, 8
_DEGREES = np.array([180.0, 90.0])
_SMALLEST_STEP = 1e-3
"""People who walk move farther than this between two steps, if positions are metres."""


def fits(begins: Beginning) -> bool:
    """Whether a file is XML with floating car data."""
    return begins.line().lstrip().startswith("<") and any("<fcd-export" in line for line in begins.lines)


def read(path: Path, options: TableOptions) -> Trajectories:
    """Read the people, element by element.

    Raises:
        SourceError: the file is damaged, holds nobody, or its positions are degrees.
    """
    people = tracks_in_rows(path, _COLUMNS, _rows(path), options)
    if not len(people):
        raise SourceError(path, None, "no <person> walks in any <timestep>", NO_PEDESTRIAN)
    order = np.lexsort((people.time_s, people.track_id))
    steps = np.diff(people.position[order], axis=0)[np.diff(people.track_id[order]) == 0]
    degrees = (np.abs(people.position) <= _DEGREES).all()
    if degrees and steps.any() and np.abs(steps).max() < _SMALLEST_STEP:
        problem = "positions look like degrees of longitude and latitude"
        raise SourceError(path, None, problem, "Write metres: run SUMO without --fcd-output.geo")
    return people


def _rows(path: Path) -> Iterator[Row]:
    reading = _Reading(path)
    with translate_errors(partial(SourceError, path, None)), path.open("rb") as file:
        fed = 0
        while chunk := file.read(_CHUNK_BYTES):
            reading.parser.Parse(chunk, False)
            fed += len(chunk)
            if fed - reading.parser.CurrentByteIndex > _LONGEST_ELEMENT_BYTES:
                raise reading.error(f"an element of more than {_LONGEST_ELEMENT_BYTES} bytes")
            yield from reading.taken()
        reading.parser.Parse(b"", True)


@dataclass
class _Reading:
    """Handlers of the XML parser, and the rows that are not taken yet."""

    path: Path
    parser: expat.XMLParserType = field(default_factory=expat.ParserCreate)
    depth: int = 0
    time: str = ""
    rows: list[Row] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.StartDoctypeDeclHandler = self.refuse

    def error(self, problem: str) -> SourceError:
        return SourceError(self.path, self.parser.CurrentLineNumber, problem)

    def refuse(self, *_: object) -> None:
        raise self.error("a document type, which could define entities; SUMO writes none")

    def start(self, name: str, attributes: Mapping[str, str]) -> None:
        if not self.depth and name != "fcd-export":
            raise self.error(f"the outermost element is <{name[:80]}>, expected <fcd-export>")
        self.depth += 1
        if self.depth > _DEEPEST:
            raise self.error(f"elements more than {_DEEPEST} deep")
        if name == "timestep":
            self.time = attributes.get("time", "")
        elif name == "person" and not attributes.get("vehicle"):
            written = [self.time, *(attributes.get(key, "") for key in _COLUMNS[1:])]
            if not written[1]:
                raise self.error("a <person> without an id")
            self.rows.append((self.parser.CurrentLineNumber, written))

    def end(self, name: str) -> None:
        self.depth -= 1

    def taken(self) -> list[Row]:
        rows, self.rows = self.rows, []
        return rows
