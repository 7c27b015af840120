"""Files of recordings: Head -> Reader -> Table -> Tracks -> checks.

A format is a module with `NAME`, `recognises(head)` and `read(path, options)`; to add one, write it into
`formats` and add it to `FORMATS`. Readers raise `ContentError` without the path, which is added here.
"""

from __future__ import annotations

import gzip
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Protocol, cast

import pyarrow as pa

from pedpred.errors import InputError
from pedpred.files import check_input
from pedpred.reading import table
from pedpred.reading.checks import check
from pedpred.reading.errors import ContentError, add_path
from pedpred.reading.formats import (
    atc,
    data_archive,
    drones,
    jupedsim,
    kitti,
    motion_capture,
    stanford,
    sumo,
    trajnet,
    vadere,
    viswalk,
    vsp,
)
from pedpred.reading.geometry import CELL_M, WALL_M, Geometry, occupancy_of
from pedpred.reading.head import GZIP, Head
from pedpred.reading.names import TrackNames
from pedpred.reading.options import ReadOptions
from pedpred.reading.table import Table
from pedpred.reading.text import check_size, numbers
from pedpred.reading.tracks import agreed_unit, to_tracks
from pedpred.scenes import OccupancyMap, Scene

_LARGEST_BYTES, _BLOCK_BYTES, _MOST_FILES = 2**31, 2**20, 100_000


class Reader(Protocol):
    """A module that reads a format.

    Attributes:
        NAME: of the format, for messages.
    """

    NAME: str

    def recognises(self, head: Head) -> bool:
        """Whether a file that begins like this has the format."""

    def read(self, path: Path, options: ReadOptions) -> Table:
        """Read a file; raises `ContentError`, without the path."""


FORMATS: tuple[Reader, ...] = (
    *(jupedsim, data_archive, sumo, stanford, drones, motion_capture),
    *(vadere, viswalk, kitti, atc, trajnet, vsp),
)
"""The first one that recognises a file is used; where none does, it is a table."""


@dataclass(frozen=True)
class Recording:
    """What was read from a file.

    Attributes:
        scene: named after the file, on free ground unless the file has a geometry.
        names: names of tracks whose ids are words.
        format: its name.
        walls: the geometry inside the file; None: it has none.
    """

    scene: Scene
    names: TrackNames
    format: str
    walls: Geometry | None = None


def format_of(path: Path, options: ReadOptions) -> Reader:
    """Find the reader of a file; named columns are those of a table, whatever it looks like.

    Raises:
        InputError: the file is missing, or of a kind that is not read; it is named.
    """
    check_input(path)
    with add_path(path):
        head = Head.of(path)
        recognised = next((reader for reader in FORMATS if reader.recognises(head)), None)
        if recognised is not None and options.columns is not None and not head.lines:
            raise ContentError(f"the columns of {recognised.NAME} are fixed", "Leave --columns out")
        if recognised is not None and options.columns is None:
            return recognised
        if not table.is_columnar(head.raw):
            head.check_text()
        return cast(Reader, table)


def read_recording(path: Path, options: ReadOptions | None = None, with_walls: bool = True) -> Recording:
    """Read the tracks in a file, or in a folder with a file for each person.

    Args:
        path: a file in one of `FORMATS`, or a table.
        options: what the file does not contain.
        with_walls: read the geometry inside it, too.

    Raises:
        InputError: it cannot be understood, or its tracks cannot be those of people; it names the line.
    """
    options = options or ReadOptions()
    if options.one_person_per_file:
        form, content = "one person per file", _read_folder(path, options)
    else:
        reader = format_of(path, options)
        with _unpack(path) as plain, add_path(path):
            form, content = reader.NAME, reader.read(plain, options)
    with add_path(path):
        tracks = to_tracks(str(path), content, options)
        unit = agreed_unit(content.unit, options)
        dt_s = check(tracks.people, str(path), unit, options.any_speed)
        walls = content.walls() if content.walls is not None and with_walls else None
        people = tracks.people
        ground = occupancy_of(walls, CELL_M, WALL_M) if walls else OccupancyMap.free_around(people.position)
        return Recording(Scene(path.stem, people, ground, dt_s), tracks.names, form, walls)


@contextmanager
def _unpack(path: Path) -> Iterator[Path]:
    """The file, or a temporary one with the content of a file that is compressed with gzip."""
    with path.open("rb") as file:
        if file.read(len(GZIP)) != GZIP:
            yield path
            return
    with TemporaryDirectory() as folder, add_path(path):
        plain = Path(folder, path.stem)
        with gzip.open(path) as packed, plain.open("wb") as file:
            while block := packed.read(_BLOCK_BYTES):
                file.write(block)
                if file.tell() > _LARGEST_BYTES:
                    raise ContentError(f"it unpacks to more than {_LARGEST_BYTES} bytes", "Divide the file")
        yield plain


def _read_folder(folder: Path, options: ReadOptions) -> Table:
    """Read a folder with one file per person; the name of the file is the id."""
    check_input(folder, folder=True)
    files = sorted(file for file in folder.iterdir() if file.is_file() and not file.name.startswith("."))
    if not 0 < len(files) <= _MOST_FILES:
        problem = f"{len(files)} files, expected 1 to {_MOST_FILES}"
        raise InputError(folder, None, problem, "Name another folder")
    parts, count = [], 0
    for file in files:
        reader = format_of(file, options)
        with add_path(file):
            part = reader.read(file, options)
            columns = {name: part.rows[name] for name in part.rows.column_names}
            columns |= {axis: pa.array(numbers(columns[axis], axis, part.before)) for axis in "xy"}
            columns["id"] = pa.array([file.stem] * part.rows.num_rows, pa.string())
            parts.append(pa.table(columns).select(sorted(columns)))
            check_size(count := count + part.rows.num_rows)
    with add_path(folder):
        return replace(part, rows=pa.concat_tables(parts), before=None)
