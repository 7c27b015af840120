"""Annotations of UCY's crowds (Lerner et al. 2007), `.vsp`: splines through control points in the picture.

    148 - the number of splines
    8 - Num of control points
    -45 203 0 -90.000000 - (2D point, m_id)

x (right) and y (up) are pixels from the middle of the picture, then a frame at 25 Hz and the gaze. People are
detected every 0.4 s, as the field does, on a cubic spline through their control points.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa

from pedpred.reading.errors import ContentError
from pedpred.reading.head import Head
from pedpred.reading.options import PIXELS, ReadOptions
from pedpred.reading.table import Table
from pedpred.reading.text import check_size, read_lines

NAME = "UCY splines"
_BEGIN = re.compile(r"\s*\d+\s+- the number of splines\s*")
_USUAL_HZ, _STEP_S = 25.0, 0.4


def recognises(head: Head) -> bool:
    """Whether the first line counts splines."""
    return bool(_BEGIN.fullmatch(head.line))


def read(path: Path, options: ReadOptions) -> Table:
    """Read the splines, pixels with y downwards; the rate is 25 Hz unless `options` says another one.

    Raises:
        ContentError: a line is wrong, or missing.
    """
    from scipy.interpolate import CubicSpline  # for these files alone

    rate_hz = options.rate_hz or _USUAL_HZ
    every = max(1, round(_STEP_S * rate_hz))
    lines = _lines(path)
    parts, rows = [np.zeros((0, 4))], 0
    for who in range(_count(lines)):
        points = np.array([_numbers(lines, 4)[:3] for _ in range(_count(lines))]).reshape(-1, 3)
        _, first = np.unique(points[:, 2], return_index=True)
        x, y, knots = points[first].T
        if not len(knots):
            continue
        begin, end = np.ceil(knots[0] / every), np.floor(knots[-1] / every) + 1
        check_size(rows := rows + max(0, int(end - begin)))
        frame = np.arange(begin, end) * every
        place = np.stack([x, -y], -1)
        if len(knots) > 1:
            place = CubicSpline(knots, place)(frame)
        parts.append(np.column_stack([frame, np.full(len(frame), who), place[: len(frame)]]))
    columns = dict(zip(("frame", "id", "x", "y"), np.concatenate(parts).T.copy(), strict=True))
    return Table(pa.table(columns), PIXELS, rate_hz)


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Line numbers and the fields of lines, without the comments after ` - `."""
    for number, line in enumerate(read_lines(path), start=1):
        if line.strip():
            yield number, re.split(r"\s-\s", line)[0].split()


def _numbers(lines: Iterator[tuple[int, list[str]]], count: int) -> list[float]:
    """The numbers of the next line."""
    number, fields = next(lines, (None, []))
    try:
        values = [float(field) for field in fields]
    except ValueError as cause:
        raise ContentError(str(cause), line=number) from cause
    if len(values) != count or not np.isfinite(values).all():
        where = "the file ends" if number is None else f"{len(values)} finite numbers"
        raise ContentError(f"{where}, expected {count}", line=number)
    return values


def _count(lines: Iterator[tuple[int, list[str]]]) -> int:
    """The number of splines, or of control points, in the next line."""
    count = int(_numbers(lines, 1)[0])
    check_size(count)
    return count
