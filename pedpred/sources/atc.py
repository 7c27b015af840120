"""Tracks of the ATC shopping centre (Brscic et al. 2013): eight numbers a line, without a header.

time [s, Unix], person, x [mm], y [mm], height [mm], speed [mm/s], direction of motion, of facing [rad]
"""

from __future__ import annotations

from dataclasses import replace
from math import pi
from pathlib import Path

from pedpred.scenes import Trajectories
from pedpred.sources.beginnings import Beginning
from pedpred.tables.options import TableOptions
from pedpred.tables.reading import read_table

_COLUMNS = ("time", "id", "x", "y", "height", "speed", "direction", "facing")
_FIRST_S, _LAST_S = 1e9, 4e9
_LOOKED_AT = 100
_LOWEST_MM = 100.0
"""Somebody among the first is as high; heights in metres are less."""


def fits(begins: Beginning) -> bool:
    """Whether lines hold eight numbers: Unix times first, heights that are not in metres, angles last."""
    try:
        rows = [[float(field) for field in line.split(",")] for line in begins.lines[:_LOOKED_AT]]
    except ValueError:
        return False
    if not any(len(row) == len(_COLUMNS) and row[4] >= _LOWEST_MM for row in rows):
        return False
    return all(
        len(row) == len(_COLUMNS)
        and _FIRST_S < row[0] < _LAST_S
        and row[1].is_integer()
        and row[5] >= 0.0
        and max(map(abs, row[6:])) <= 2 * pi
        for row in rows
    )


def read(path: Path, options: TableOptions) -> Trajectories:
    """Read the detections.

    Raises:
        SourceError: a line is wrong.
    """
    return read_table(path, replace(options, columns=_COLUMNS, unit="mm"))
