"""Recordings in a single file; what a file begins with says which format it has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from pedpred.errors import SourceError, ValueRuleError, worded
from pedpred.files import translate_errors
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.sources import (
    atc,
    data_archive,
    drones,
    jupedsim_database,
    kitti,
    motion_capture,
    stanford,
    sumo,
    trajnet,
    vadere,
    viswalk,
)
from pedpred.sources.beginnings import Beginning
from pedpred.sources.doubts import doubt_digits, doubt_fractions, doubt_rate, doubt_starts
from pedpred.sources.geometries import CELL_M, WALL_M
from pedpred.sources.plausibility import (
    check_degrees,
    check_speeds,
    check_titles,
)
from pedpred.sources.times import check_brief, check_clock, check_digits, doubt_whole_seconds
from pedpred.sources.untitled import read_untitled
from pedpred.sources.walls import Walls, occupancy_of
from pedpred.tables.columnar import is_columnar
from pedpred.tables.lines import has_header, lines_of
from pedpred.tables.options import TableOptions
from pedpred.tables.placeholders import without_placeholders
from pedpred.tables.reading import read_table
from pedpred.tables.titles import naming
from pedpred.tables.units import PIXELS

_NOBODY = "no detections: no row is left that says when somebody is where"


@dataclass(frozen=True)
class Format:
    """How recordings of one kind are recognised and read.

    Attributes:
        name: as people know it.
        fits: whether a file that begins like this has the format.
        read: the detections; with what gives the geometry, where a file takes long to open.
        walls: the geometry inside the file; None: it has none.
        unit: of its lengths; None: any, so that `--unit` has a meaning.
        pixels: whether positions are pixels, or may be.
    """

    name: str
    fits: Callable[[Beginning], bool]
    read: Callable[[Path, TableOptions], Trajectories | tuple[Trajectories, Callable[[], Walls | None]]]
    walls: Callable[[Path], Walls | None] = lambda path: None
    unit: str | None = "m"
    pixels: bool = False


def read_file(path: Path, options: TableOptions | None = None, with_walls: bool = True) -> Scene:
    """Read the tracks in a file; the scene is named after the file, on free ground unless it has a geometry.

    Args:
        path: a file in one of `FORMATS`.
        options: what the file does not say itself.
        with_walls: read the geometry inside it, too.

    Raises:
        SourceError: the file cannot be understood, nobody is detected twice, its times are not seconds,
            positions are degrees, titles are exchanged, or people would move at impossible speeds.
        ValueRuleError: an option has no meaning for this format.
    """
    options = options or TableOptions()
    kind = format_of(path, options)
    meant: dict[str, tuple[object, bool, str]] = {
        "--unit": (options.unit, kind.unit is None, "whose unit is known"),
        "--scale": (options.pixel_m, kind.pixels, "whose positions are not pixels"),
        "--class": (options.classes or None, kind is _TABLE, "without classes to choose from"),
        "--columns": (options.columns, kind is _TABLE, "whose columns are known"),
    }
    for name, (value, has_meaning, why) in meant.items():
        if value is not None and not has_meaning:
            raise ValueRuleError(name, value, f"{path} is {kind.name}, {why}")
    content = kind.read(path, options)
    people, walls_in = content if isinstance(content, tuple) else (content, partial(kind.walls, path))
    trajectories = without_placeholders(path, people)
    titled = kind is _TABLE and options.columns is None
    unit = PIXELS if options.are_pixels else kind.unit
    dt_s = checked_interval_s(path, trajectories, titled, options, unit)
    walls = walls_in() if with_walls else None
    if walls is None:
        return Scene(path.stem, trajectories, OccupancyMap.free_around(trajectories.position), dt_s)
    with translate_errors(partial(SourceError, path, None)):
        return Scene(path.stem, trajectories, occupancy_of(walls, CELL_M, WALL_M), dt_s)


def format_of(path: Path, options: TableOptions | None = None) -> Format:
    """Find out which format a file has.

    Args:
        path: the file.
        options: a text whose columns are named is a table, whatever it looks like.

    Raises:
        SourceError: it is missing, or of a kind that is not read; it is named.
    """
    begins = Beginning.of(path)
    if is_columnar(path):
        return _DRONES if drones.are_titles(lines_of(path).titles) else _TABLE
    if begins.lines and options is not None and options.columns is not None:
        return _TABLE
    if recognised := next((kind for kind in FORMATS if kind.fits(begins)), None):
        return recognised
    if problem := begins.foreign():
        raise problem
    return _TABLE if has_header(path) else _TEXT


def checked_interval_s(
    path: Path, people: Trajectories, titled: bool, options: TableOptions, fixed: str | None = None
) -> float:
    """Check that tracks can be those of people; return the usual time between two detections, s.

    Args:
        path: the file, for errors.
        people: what was read from it.
        titled: its own titles say what its columns hold.
        options: with the unit of lengths that the caller has said, or the reader found.
        fixed: the unit that the format has, or pixels; None: the caller may say it.

    Raises:
        SourceError: nobody is detected, or nobody twice, times are not seconds, positions are degrees,
            titles are exchanged, or people would move at impossible speeds.
    """
    if not len(people):
        tracks = worded("Name a file with tracks", "Give a table with tracks")
        raise SourceError(path, None, _NOBODY, f"{tracks}; warnings say which rows were left out")
    sure = options.unit is not None
    said = options.found.of_lengths if fixed is None and not sure else None
    try:
        dt_s = people.usual_interval_s()
    except ValueRuleError as cause:
        remedy = f"If another column holds the ids, name all in order: {naming()}"
        raise SourceError(path, None, str(cause), f"A track needs several detections. {remedy}") from cause
    check_clock(path, dt_s)
    check_digits(path, people)
    doubt_whole_seconds(path, people, dt_s)
    if not sure:
        check_degrees(path, people)
        if said is None and fixed is None:
            doubt_fractions(path, people)
    if titled:
        check_titles(path, people)
    if not sure:
        check_brief(path, people)
    check_speeds(path, people, sure, fixed=fixed, said=said)
    doubt_starts(path, people)
    if not sure:
        doubt_digits(path, people)
    if options.found.rate_hz is not None:
        doubt_rate(path, people, options.found.rate_hz, options.rate_hz is not None)
    return dt_s


_TEXT = Format("text without titles", lambda begins: False, read_untitled, unit=None, pixels=True)
_TABLE = Format("table", lambda begins: False, read_table, unit=None, pixels=True)
"""What other texts are, with and without a header."""
_DRONES = Format("drone recording (inD, rounD, uniD)", drones.fits, drones.read)

FORMATS = (
    Format("JuPedSim database", jupedsim_database.fits, jupedsim_database.read, jupedsim_database.read_walls),
    Format("Pedestrian Dynamics Data Archive", data_archive.fits, data_archive.read, data_archive.read_walls),
    Format("SUMO FCD", sumo.fits, sumo.read),
    Format("Stanford Drone Dataset", stanford.fits, stanford.read, pixels=True),
    _DRONES,
    Format("motion capture (THÖR, THÖR-MAGNI, QTM)", motion_capture.fits, motion_capture.read, unit="mm"),
    Format("Vadere", vadere.fits, vadere.read),
    Format("PTV Viswalk", viswalk.fits, viswalk.read, unit=None),
    Format("KITTI tracking labels", kitti.fits, kitti.read),
    Format("ATC shopping centre", atc.fits, atc.read, unit="mm"),
    Format("TrajNet++", trajnet.fits, trajnet.read_ndjson),
)
"""The first one that fits is used; where none does, a file is a text or a table."""
