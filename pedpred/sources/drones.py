"""Drone recordings of the levelXdata family (inD, rounD, uniD): `NN_tracks.csv` and the two files beside it.

`NN_tracksMeta.csv` says which tracks are pedestrians, `NN_recordingMeta.csv` the rate; positions are metres.
The files may have any spelling that a table has, or be Parquet: as tables, cars would be people.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from pedpred.errors import SourceError
from pedpred.scenes import Trajectories
from pedpred.sources.beginnings import NO_PEDESTRIAN, Beginning
from pedpred.sources.frames import agreed_rate, tracks_in_frames
from pedpred.tables.decimals import with_decimal_points
from pedpred.tables.lines import lines_of, of_width, titles_in
from pedpred.tables.options import TableOptions
from pedpred.tables.text import Row, number, read_numbers

_WANTED = {"trackId": "track_id", "frame": "frame", "xCenter": "x_m", "yCenter": "y_m"}
_NUMBERS = {"xCenter", "yCenter", "frameRate"}
_TRACKS, _USUAL, _LONGEST = "tracks", ".csv", 200


def fits(begins: Beginning) -> bool:
    """Whether the header is that of such tracks."""
    return are_titles(titles_in(begins.line()))


def are_titles(titles: Sequence[str]) -> bool:
    """Whether a table has the titles of such tracks."""
    return "trackLifetime" in titles and set(_WANTED) <= set(titles)


def read(path: Path, options: TableOptions) -> Trajectories:
    """Read the pedestrians.

    Args:
        path: NN_tracks.csv.
        options: `rate_hz` is used where NN_recordingMeta.csv is missing.

    Raises:
        SourceError: a file is missing or wrong, or nobody is a pedestrian.
    """
    if _TRACKS not in path.name:
        problem = "two files beside it have to be found, by the name of this one, which is not NN_tracks.csv"
        raise SourceError(path, None, problem, "Give the files their names, such as 00_tracks.csv")
    meta = _beside(path, "tracksMeta")
    titles, rows = _opened(meta, ("trackId", "class"))
    who, kind = (titles.index(title) for title in ("trackId", "class"))
    pedestrians = {fields[who] for _, fields in rows if fields[kind].strip().lower() == "pedestrian"}
    rate_hz = _rate_hz(_beside(path, "recordingMeta"), options)
    titles, rows = _opened(path, tuple(_WANTED))
    at = titles.index("trackId")
    columns = read_numbers(path, (row for row in rows if row[1][at] in pedestrians), titles, _WANTED)
    if not len(columns["line"]):
        raise SourceError(path, None, f"nobody is a pedestrian, as {meta.name} says", NO_PEDESTRIAN)
    return tracks_in_frames(path, columns, rate_hz)


def _beside(path: Path, name: str) -> Path:
    """Another file of a recording; a table in another form may lie beside the published ones."""
    other = path.with_name(path.name.replace(_TRACKS, name))
    return other if other.exists() else other.with_suffix(_USUAL)


def _rate_hz(path: Path, options: TableOptions) -> float:
    """The rate that a file or the caller says; errors of `agreed_rate`."""
    if not path.exists():
        return agreed_rate(path, None, options, "the file is missing, which says the rate")
    titles, rows = _opened(path, ("frameRate",))
    line, fields = next(rows, (1, [""] * len(titles)))
    said = number(path, line, "frameRate", fields[titles.index("frameRate")])
    return agreed_rate(path, said, options, "no frameRate", "frameRate", line)


def _opened(path: Path, needed: Sequence[str]) -> tuple[Sequence[str], Iterator[Row]]:
    """Titles and rows of one of the files.

    Raises:
        SourceError: it is missing, or a column is.
    """
    if not path.exists():
        raise SourceError(path, None, "the file is missing", "The three files of a recording lie together")
    lines = lines_of(path)
    titles = lines.titles
    if missing := [title for title in needed if title not in titles]:
        listed = ", ".join(titles)[:_LONGEST] or lines.begins[:_LONGEST]
        raise SourceError(path, lines.line, f"no column {missing[0]}; there are {listed}")
    rows = of_width(path, lines.rows, titles)
    at = [titles.index(title) for title in needed if title in _NUMBERS]
    return titles, with_decimal_points(path, rows, at, lines.separator)
