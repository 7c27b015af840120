"""Pixels of a picture -> the ground, by the size of a pixel or by a homography."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from pedpred.geometry import Homography
from pedpred.reading.errors import ContentError, add_path, row_error
from pedpred.reading.options import ReadOptions
from pedpred.reading.text import first_lines

_MATRIX = "A homography has 3 x 3 numbers, which map (x, y, 1) in pixels to metres, up to scale"
_LONGEST = 100


def read_homography(path: Path) -> Homography:
    """Read a matrix that maps (x, y, 1) in pixels to the ground, m, up to scale, as OpenCV's findHomography.

    Args:
        path: a text with nine numbers, row by row; blanks, commas or brackets separate them, and lines that
            begin with `#` are comments.

    Raises:
        InputError: it is not such text, or the matrix is not invertible.
    """
    with add_path(path):
        lines = [line for line in first_lines(path, _LONGEST) if not line.startswith("#")]
        fields = re.sub(r"[\[\](),;]", " ", " ".join(lines)).split()
        try:
            numbers = np.array(fields, np.float64).reshape(3, 3)
        except ValueError as cause:
            raise ContentError(f"{cause}"[:200], _MATRIX) from cause
        return Homography(numbers[:, [1, 0, 2]])  # that class has (row, column, 1)


def on_ground(options: ReadOptions, position: np.ndarray, kept: np.ndarray, before: int | None) -> np.ndarray:
    """Map pixels to the ground.

    Args:
        options: with the size of a pixel or a homography.
        position: (x, y), pixels from the left and from the top. [M, 2]
        kept: the rows that matter. [M] bool
        before: lines of the file before the first row; see `row_error`.

    Returns:
        (x, y), m; NaN in other rows. [M, 2]

    Raises:
        ContentError: the size of a pixel is unknown, or the homography's horizon is among the people.
    """
    ground = np.full_like(position, np.nan)
    if options.homography is None:
        if options.pixel_m is None:
            remedy = "Give the side of a pixel in metres: --scale 0.03, or a homography: --homography H.txt"
            raise ContentError("positions are in pixels, and their size is unknown", remedy)
        ground[kept] = np.float64(options.pixel_m) * position[kept] * [1, -1]
        return ground
    pixels_rc = position[kept][:, ::-1]
    matrix = options.homography.matrix
    depth = pixels_rc @ matrix[2, :2] + matrix[2, 2]
    beyond = np.flatnonzero((depth == 0) | (np.sign(depth) != np.sign(np.median(depth))))
    for row in beyond[:1]:
        y, x = pixels_rc[row].tolist()
        problem = f"the pixel x = {x:g}, y = {y:g} lies on the other side of the homography's horizon"
        remedy = f"It is not that of this picture. {_MATRIX}"
        raise row_error(np.flatnonzero(kept)[row], before, problem, remedy)
    ground[kept] = options.homography.to_world(pixels_rc)
    return ground
