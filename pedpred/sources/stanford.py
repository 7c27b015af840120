"""Annotations of the Stanford Drone Dataset (Robicquet et al., ECCV 2016): boxes in pixels.

    track xmin ymin xmax ymax frame lost occluded generated "Pedestrian"

People are at the centres of their boxes, see `pedpred.tables.pictures`. Boxes outside the picture (`lost`)
and other road users are left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from pedpred.errors import SourceError
from pedpred.files import translate_errors
from pedpred.scenes import Trajectories
from pedpred.sources.beginnings import NO_PEDESTRIAN, Beginning
from pedpred.sources.frames import tracks_in_frames
from pedpred.tables.options import TableOptions
from pedpred.tables.pictures import on_ground
from pedpred.tables.text import Row, check_width, read_numbers, text_lines

_COLUMNS = ("track", "xmin", "ymin", "xmax", "ymax", "frame", "lost", "occluded", "generated", "label")
_NAMES = {"track": "track_id", "frame": "frame"} | {name: name for name in _COLUMNS[1:5]}
_ROW = re.compile(r'\d+( -?\d+(\.\d+)?){4} \d+ [01] [01] [01] ("\w+"|[A-Z]\w+)')
_USUAL_HZ = 30.0
_LOOKED_AT = 10


def fits(begins: Beginning) -> bool:
    """Whether one of the first lines is such a box, with blanks, tabs or commas between the numbers."""
    return any(_ROW.fullmatch(" ".join(_fields(line))) for line in begins.lines[:_LOOKED_AT])


def read(path: Path, options: TableOptions) -> Trajectories:
    """Read the pedestrians.

    Args:
        path: the file.
        options: `pixel_m` or `homography` is needed; `rate_hz` is 30 unless it is given.

    Raises:
        SourceError: the size of a pixel is unknown, a line is wrong, there is no pedestrian, or the
            homography's horizon is among the people.
    """
    columns = read_numbers(path, _pedestrians(path), _COLUMNS, _NAMES)
    if not len(columns["line"]):
        raise SourceError(path, None, 'no row with the label "Pedestrian" that is not lost', NO_PEDESTRIAN)
    x, y = (columns[f"{axis}min"] / 2 + columns[f"{axis}max"] / 2 for axis in "xy")
    with translate_errors(partial(SourceError, path, None)):
        columns["x_m"], columns["y_m"] = on_ground(path, options, x, y, columns["line"]).T
    return tracks_in_frames(path, columns, options.rate_hz or _USUAL_HZ)


def _pedestrians(path: Path) -> Iterator[Row]:
    for line, text in text_lines(path):
        fields = _fields(text)
        check_width(path, line, fields, _COLUMNS)
        if fields[-1].strip('"') == "Pedestrian" and fields[_COLUMNS.index("lost")] != "1":
            yield line, fields


def _fields(line: str) -> list[str]:
    return line.replace(",", " ").split()
