"""Tracks of the ATC shopping centre (Brscic et al. 2013): eight numbers a line, without a header.

    1351038029.371,9021300,-12000.0,3400.0,1650.0,1200.0,0.000,0.100

time [s, Unix], person, x [mm], y [mm], height [mm], speed [mm/s], direction of motion, of facing [rad]
"""

from __future__ import annotations

from math import pi
from pathlib import Path

from pedpred.reading.head import Head
from pedpred.reading.options import ReadOptions
from pedpred.reading.table import Table
from pedpred.reading.text import TextForm, read_columns

NAME = "ATC shopping centre"
_TITLES = ("time", "id", "x", "y", "height", "speed", "direction", "facing")
_FIRST_S, _LAST_S = 1e9, 4e9
_LOWEST_MM = 100.0
"""Somebody among the first is as high; heights in metres are less."""


def recognises(head: Head) -> bool:
    """Whether lines hold eight numbers: Unix times first, heights that are not in metres, angles last."""
    try:
        rows = [[float(field) for field in line.split(",")] for line in head.lines[:100]]
    except ValueError:
        return False
    if not any(len(row) == len(_TITLES) and row[4] >= _LOWEST_MM for row in rows):
        return False
    return all(
        len(row) == len(_TITLES)
        and _FIRST_S < row[0] < _LAST_S
        and row[1].is_integer()
        and row[5] >= 0.0
        and max(map(abs, row[6:])) <= 2 * pi
        for row in rows
    )


def read(path: Path, options: ReadOptions) -> Table:
    """Read the detections."""
    rows = read_columns(path, TextForm(_TITLES), {title: title for title in _TITLES[:4]})
    return Table(rows, "mm", before=0)
