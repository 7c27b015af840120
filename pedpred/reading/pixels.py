"""Pixels of a picture -> the ground, by the size of a pixel or by a homography."""

from __future__ import annotations

import re
from itertools import islice
from pathlib import Path

import numpy as np

from pedpred.geometry import Homography
from pedpred.reading.errors import ContentError, add_path
from pedpred.reading.options import ReadOptions
from pedpred.reading.text import read_lines

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
        lines = islice(read_lines(path), _LONGEST)
        fields = " ".join(
            re.sub(r"[\[\](),;]", " ", line) for line in lines if not line.startswith("#")
        ).split()
        try:
            numbers = np.array(fields, np.float64)
        except ValueError as cause:
            raise ContentError(f"{cause}"[:200], _MATRIX) from cause
        if numbers.size != 9 or not np.isfinite(numbers).all():
            raise ContentError(f"{numbers.size} finite numbers, expected 9", _MATRIX)
        return Homography(numbers.reshape(3, 3)[:, [1, 0, 2]])  # that class has (row, column, 1)


def on_ground(options: ReadOptions, x: np.ndarray, y: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Map pixels to the ground.

    Args:
        options: with the size of a pixel or a homography.
        x: pixels from the left. [M]
        y: pixels from the top. [M]
        line: of the file. [M]

    Returns:
        (x, y), m. [M, 2]

    Raises:
        ContentError: the size of a pixel is unknown, or the homography's horizon is among the people.
    """
    if options.homography is None:
        if options.pixel_m is None:
            remedy = "Give the side of a pixel in metres: --scale 0.03, or a homography: --homography H.txt"
            raise ContentError("positions are in pixels, and their size is unknown", remedy)
        return np.float64(options.pixel_m) * np.stack([x, -y], axis=-1)
    pixels_rc = np.stack([y, x], axis=-1)
    matrix = options.homography.matrix
    depth = pixels_rc @ matrix[2, :2] + matrix[2, 2]
    beyond = np.flatnonzero((depth == 0) | (np.sign(depth) != np.sign(np.median(depth))))
    if len(beyond):
        row, column = pixels_rc[beyond[0]].tolist()
        problem = f"the pixel x = {column:g}, y = {row:g} lies on the other side of the homography's horizon"
        raise ContentError(problem, f"It is not that of this picture. {_MATRIX}", int(line[beyond[0]]))
    return options.homography.to_world(pixels_rc)
