"""Annotations of the Stanford Drone Dataset (Robicquet et al., ECCV 2016): boxes in pixels.

    track xmin ymin xmax ymax frame lost occluded generated "Pedestrian"

People are at the centres of their boxes. Pixels count downwards, so that y is negative; the picture's upper
left corner is the origin. Boxes outside the picture (`lost`) and other road users are passed over.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError
from pedpred.files import translate_errors
from pedpred.scenes import Trajectories
from pedpred.sources.beginnings import Beginning
from pedpred.tables.options import TableOptions
from pedpred.tables.text import Row, check_unique, check_width, read_numbers, text_rows

_COLUMNS = ("track", "xmin", "ymin", "xmax", "ymax", "frame", "lost", "occluded", "generated", "label")
_NAMES = {"track": "track_id", "frame": "frame"} | {name: name for name in _COLUMNS[1:5]}
_ROW = re.compile(r'\d+( -?\d+(\.\d+)?){4} \d+ [01] [01] [01] "\w+"')
_USUAL_HZ = 30.0
_LOOKED_AT = 10


def fits(begins: Beginning) -> bool:
    """Whether one of the first lines is such a box."""
    return any(_ROW.fullmatch(line.strip()) for line in begins.lines[:_LOOKED_AT])


def read(path: Path, options: TableOptions) -> Trajectories:
    """Read the pedestrians.

    Args:
        path: the file.
        options: `pixel_m` is needed; `rate_hz` is 30 unless it is given.

    Raises:
        SourceError: nobody says the size of a pixel, a line is wrong, or there is no pedestrian.
    """
    if options.pixel_m is None:
        remedy = "Say how long the side of a pixel is, in metres: --scale 0.03"
        raise SourceError(path, None, "boxes are in pixels, and the file does not say their size", remedy)
    columns = read_numbers(path, _pedestrians(path), _COLUMNS, _NAMES)
    if not len(columns["line"]):
        raise SourceError(path, None, 'no row with the label "Pedestrian" that is not lost')
    check_unique(path, columns, "track_id", "frame")
    x, y = (columns[f"{axis}min"] / 2 + columns[f"{axis}max"] / 2 for axis in "xy")
    with translate_errors(partial(SourceError, path, None)):
        position = options.pixel_m * np.stack([x, -y], axis=-1)
        return Trajectories(columns["frame"] / (options.rate_hz or _USUAL_HZ), columns["track_id"], position)


def _pedestrians(path: Path) -> Iterator[Row]:
    for line, fields in text_rows(path):
        check_width(path, line, fields, _COLUMNS)
        if fields[-1].strip('"') == "Pedestrian" and fields[_COLUMNS.index("lost")] != "1":
            yield line, fields
