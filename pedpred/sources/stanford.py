"""Annotations of the Stanford Drone Dataset (Robicquet et al., ECCV 2016): boxes in pixels.

    track xmin ymin xmax ymax frame lost occluded generated "Pedestrian"

People are at the centres of their boxes. With the size of a pixel, the picture's upper left corner is the
origin, and y is negative, because pixels count downwards; with a homography, the world frame is that of the
homography. Boxes outside the picture (`lost`) and other road users are left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError, ValueRuleError
from pedpred.files import translate_errors
from pedpred.geometry import Homography
from pedpred.scenes import Trajectories
from pedpred.sources.beginnings import Beginning
from pedpred.tables.options import TableOptions
from pedpred.tables.text import Row, check_unique, check_width, number, read_numbers, text_lines, text_rows

_COLUMNS = ("track", "xmin", "ymin", "xmax", "ymax", "frame", "lost", "occluded", "generated", "label")
_NAMES = {"track": "track_id", "frame": "frame"} | {name: name for name in _COLUMNS[1:5]}
_ROW = re.compile(r'\d+( -?\d+(\.\d+)?){4} \d+ [01] [01] [01] ("\w+"|[A-Z]\w+)')
_USUAL_HZ = 30.0
_LOOKED_AT = 10
_NUMBERS, _SEPARATORS = 9, re.compile(r"[\[\](),;]")
_MATRIX = "A homography has 3 x 3 numbers, which map (x, y, 1) in pixels to metres, up to scale"


@dataclass(frozen=True)
class PictureOptions(TableOptions):
    """What annotations in pictures do not say themselves.

    Attributes:
        homography: where pixels lie on the ground, in place of `pixel_m`; None: the camera looks straight
            down.
    """

    homography: Homography | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.homography is not None and self.pixel_m is not None:
            raise ValueRuleError(
                "pixel_m", self.pixel_m, "a homography contains the size of a pixel: omit one"
            )


def read_homography(path: Path) -> Homography:
    """Read a matrix that maps (x, y, 1) in pixels to the ground, m, up to scale, as OpenCV's findHomography.

    Args:
        path: a text with nine numbers, row by row; blanks, commas or brackets separate them.

    Raises:
        SourceError: it is not such text, or the matrix is not invertible.
    """
    rows = [
        (line, _SEPARATORS.sub(" ", text).split()) for line, text in islice(text_lines(path), _NUMBERS + 1)
    ]
    numbers = [number(path, line, "homography", field) for line, fields in rows for field in fields]
    if len(numbers) != _NUMBERS:
        raise SourceError(path, None, f"{len(numbers)} numbers, expected {_NUMBERS}", _MATRIX)
    with translate_errors(partial(SourceError, path, None, remedy=_MATRIX)):
        return Homography(np.array(numbers).reshape(3, 3)[:, [1, 0, 2]])  # that class has (row, column, 1)


def fits(begins: Beginning) -> bool:
    """Whether one of the first lines is such a box."""
    return any(_ROW.fullmatch(line.strip()) for line in begins.lines[:_LOOKED_AT])


def read(path: Path, options: TableOptions) -> Trajectories:
    """Read the pedestrians.

    Args:
        path: the file.
        options: `pixel_m`, or the homography of `PictureOptions`, is needed; `rate_hz` is 30 unless it is
            given.

    Raises:
        SourceError: the size of a pixel is unknown, a line is wrong, there is no pedestrian, or the
            homography's horizon is among the people.
    """
    homography = options.homography if isinstance(options, PictureOptions) else None
    if options.pixel_m is None and homography is None:
        remedy = "Say how long the side of a pixel is, in metres: --scale 0.03, or give --homography H.txt"
        raise SourceError(path, None, "boxes are in pixels, and the file does not say their size", remedy)
    columns = read_numbers(path, _pedestrians(path), _COLUMNS, _NAMES)
    if not len(columns["line"]):
        raise SourceError(path, None, 'no row with the label "Pedestrian" that is not lost')
    check_unique(path, columns, "track_id", "frame")
    x, y = (columns[f"{axis}min"] / 2 + columns[f"{axis}max"] / 2 for axis in "xy")
    with translate_errors(partial(SourceError, path, None)):
        if homography is None:
            position = np.float64(options.pixel_m) * np.stack([x, -y], axis=-1)
        else:
            position = _on_ground(path, homography, np.stack([y, x], axis=-1), columns["line"])
        return Trajectories(columns["frame"] / (options.rate_hz or _USUAL_HZ), columns["track_id"], position)


def _on_ground(path: Path, homography: Homography, pixels_rc: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Map pixels to the ground, m. All must lie on one side of the horizon. [M, 2]."""
    depth = pixels_rc @ homography.matrix[2, :2] + homography.matrix[2, 2]
    beyond = np.flatnonzero((depth == 0) | (np.sign(depth) != np.sign(np.median(depth))))
    if len(beyond):
        row, column = pixels_rc[beyond[0]].tolist()
        problem = f"the pixel x = {column:g}, y = {row:g} lies on the other side of the homography's horizon"
        raise SourceError(path, int(line[beyond[0]]), problem, f"It is not that of this picture. {_MATRIX}")
    return homography.to_world(pixels_rc)


def _pedestrians(path: Path) -> Iterator[Row]:
    for line, fields in text_rows(path):
        check_width(path, line, fields, _COLUMNS)
        if fields[-1].strip('"') == "Pedestrian" and fields[_COLUMNS.index("lost")] != "1":
            yield line, fields
