"""Text files of PeTrack, JuPedSim and PedPy, which hold heads filmed in a laboratory, as a `Scene`.

    # framerate: 16
    # id frame x/m y/m z/m
    1 53 3.7253 -0.837 1.73

Lines that begin with `#` are comments. Lengths are metres unless a comment names another unit, as in `x/cm`,
`x [mm]` or `in centimetres`. Columns after the fourth are not used. `pedpred.sources.geometry_xml` reads the
geometry that comes with the text.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from pedpred.errors import SourceError
from pedpred.fields import check_ranges, finite, parsed
from pedpred.files import translate_errors
from pedpred.scenes import Scene, Trajectories
from pedpred.sources.frames import tracks_in_frames
from pedpred.sources.geometry_xml import read_xml
from pedpred.sources.walls import occupancy_of
from pedpred.tables.comments import MOST_COMMENTS, NO_RATE, frame_rate_hz, unit_of_lengths
from pedpred.tables.options import FASTEST_HZ, SLOWEST_HZ, TableOptions
from pedpred.tables.text import Row, read_numbers, text_rows
from pedpred.tables.titles import LENGTHS
from pedpred.tables.units import PIXELS, UNITS

COLUMNS = ("id", "frame", "x", "y")
_NAMES = ("track_id", "frame", "x_m", "y_m")


@dataclass(frozen=True)
class LaboratorySettings:
    """What the files of a recording do not say.

    Attributes:
        recording: name of its files.
        resolution_m: see `occupancy_of`.
        thickness_m: see there.
        open_ends: see there.
        open_end_m: see there.
        frame_rate_hz: needed if the text has none.
    """

    recording: str
    resolution_m: float
    thickness_m: float
    open_ends: Sequence[Sequence[Sequence[float]]] = ()
    open_end_m: float = 0.0
    frame_rate_hz: float | None = None

    def __post_init__(self) -> None:
        check_ranges(self, {"resolution_m": "[0.001, 100]", "thickness_m": "(0, 1000]"})
        check_ranges(self, {"open_end_m": "[0, 1000]"})
        if self.frame_rate_hz is not None:
            check_ranges(self, {"frame_rate_hz": f"[{SLOWEST_HZ}, {FASTEST_HZ}]"})
        if self.open_ends != ():
            finite("open_ends", self.open_ends, (None, 2, 2))


def read_laboratory(folder: Path, name: str, settings: Mapping[str, Any]) -> Scene:
    """Read one recording and its geometry.

    Args:
        folder: holds <recording>.txt and <recording>.xml.
        name: name of the scene.
        settings: the fields of `LaboratorySettings`.

    Raises:
        SourceError: a file is missing or wrong; it names file, line and value.
        ValueRuleError: a setting is out of range.
    """
    how: LaboratorySettings = parsed(LaboratorySettings, settings)
    path = folder / f"{how.recording}.txt"
    walls = read_xml(path.with_suffix(".xml"))
    with translate_errors(partial(SourceError, path.with_suffix(".xml"), None)):
        occupancy = occupancy_of(walls, how.resolution_m, how.thickness_m, how.open_ends, how.open_end_m)
    trajectories = read_tracks(path, how.frame_rate_hz)
    with translate_errors(partial(SourceError, path, None)):
        return Scene(name, trajectories, occupancy, trajectories.usual_interval_s())


def read_tracks(path: Path, rate_hz: float | None = None) -> Trajectories:
    """Read the text alone.

    Args:
        path: the file.
        rate_hz: frames per second, needed if no comment has it.

    Raises:
        SourceError: the file is missing or wrong; it names line and value.
    """
    comments: list[str] = []
    rows = _without_comments(text_rows(path), comments)
    line, first = next(rows, (None, []))
    if line is None:
        raise SourceError(path, None, "no detections, the file is empty")
    if len(first) < len(COLUMNS):
        expected = f"expected {' '.join(COLUMNS)} and perhaps z"
        raise SourceError(path, line, f"{len(first)} columns, {expected}")
    titles = (*COLUMNS, "z", *(f"column_{n}" for n in range(6, len(first) + 1)))[: len(first)]
    wanted = dict(zip(COLUMNS, _NAMES, strict=True))
    columns = read_numbers(path, chain([(line, first)], rows), titles, wanted)
    unit = unit_of_lengths(path, comments, TableOptions()) or "m"
    if unit == PIXELS:
        raise SourceError(path, None, "lengths are said to be pixels", "Write them in metres")
    columns |= {name: UNITS[unit] * columns[name] for name in LENGTHS}
    rate_hz = frame_rate_hz(path, comments, rate_hz)
    if rate_hz is None:
        raise SourceError(path, None, *NO_RATE)
    return tracks_in_frames(path, columns, rate_hz)


def _without_comments(rows: Iterable[Row], comments: list[str]) -> Iterator[Row]:
    """Yield the rows, and collect what the comments say."""
    for line, fields in rows:
        if not fields[0].startswith("#"):
            yield line, fields
        elif len(comments) < MOST_COMMENTS:
            comments.append(" ".join(fields))
