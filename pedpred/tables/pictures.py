"""Positions in the pixels of a picture: where they lie on the ground, by the size of a pixel or a homography.

With the size of a pixel, the picture's upper left corner is the origin, and y is negative, because pixels
count downwards; with a homography, the world frame is that of the homography.
"""

from __future__ import annotations

import re
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError, worded
from pedpred.files import translate_errors
from pedpred.geometry import Homography
from pedpred.tables.options import TableOptions
from pedpred.tables.text import number, text_lines

_NUMBERS, _SEPARATORS = 9, re.compile(r"[\[\](),;]")
_MATRIX = "A homography has 3 x 3 numbers, which map (x, y, 1) in pixels to metres, up to scale"


def read_homography(path: Path) -> Homography:
    """Read a matrix that maps (x, y, 1) in pixels to the ground, m, up to scale, as OpenCV's findHomography.

    Args:
        path: a text with nine numbers, row by row; blanks, commas or brackets separate them. Lines that
            begin with `#`, as NumPy writes them, are comments.

    Raises:
        SourceError: it is not such text, or the matrix is not invertible.
    """
    lines = ((line, text) for line, text in text_lines(path) if not text.startswith("#"))
    rows = [(line, _SEPARATORS.sub(" ", text).split()) for line, text in islice(lines, _NUMBERS + 1)]
    numbers = [number(path, line, "homography", field, _MATRIX) for line, fields in rows for field in fields]
    if len(numbers) != _NUMBERS:
        raise SourceError(path, None, f"{len(numbers)} numbers, expected {_NUMBERS}", _MATRIX)
    with translate_errors(partial(SourceError, path, None, remedy=_MATRIX)):
        return Homography(np.array(numbers).reshape(3, 3)[:, [1, 0, 2]])  # that class has (row, column, 1)


def on_ground(
    path: Path, options: TableOptions, x: np.ndarray, y: np.ndarray, line: np.ndarray
) -> np.ndarray:
    """Map pixels to the ground.

    Args:
        path: the file, for errors.
        options: `pixel_m` or `homography` is needed.
        x: pixels from the left. [M]
        y: pixels from the top. [M]
        line: of the file. [M]

    Returns:
        (x, y), m. [M, 2]

    Raises:
        SourceError: the size of a pixel is unknown, or the homography's horizon is among the people.
    """
    if options.homography is not None:
        return _beneath(path, options.homography, np.stack([y, x], axis=-1), line)
    if options.pixel_m is None:
        remedy = worded(
            "Say how long the side of a pixel is, in metres: --scale 0.03, or give --homography H.txt",
            "Bring them to metres first",
        )
        raise SourceError(path, None, "positions are in pixels, and their size is unknown", remedy)
    return np.float64(options.pixel_m) * np.stack([x, -y], axis=-1)


def _beneath(path: Path, homography: Homography, pixels_rc: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Map pixels by a homography; all must lie on one side of its horizon."""
    depth = pixels_rc @ homography.matrix[2, :2] + homography.matrix[2, 2]
    beyond = np.flatnonzero((depth == 0) | (np.sign(depth) != np.sign(np.median(depth))))
    if len(beyond):
        row, column = pixels_rc[beyond[0]].tolist()
        problem = f"the pixel x = {column:g}, y = {row:g} lies on the other side of the homography's horizon"
        raise SourceError(path, int(line[beyond[0]]), problem, f"It is not that of this picture. {_MATRIX}")
    return homography.to_world(pixels_rc)
