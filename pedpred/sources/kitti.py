"""Labels of KITTI's tracking benchmark, and recordings in their form (AgentFormer's files of ETH and UCY).

frame, id, type, truncated, occluded, alpha, box in the picture (4), height, width, length, x, y, z [m, camera
frame], rotation; the ground has the axes x (right) and z (ahead).
"""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

from pedpred.scenes import Trajectories
from pedpred.sources.beginnings import Beginning
from pedpred.tables.options import TableOptions
from pedpred.tables.reading import read_table
from pedpred.tables.text import is_number

_COLUMNS = (
    *("frame", "id", "class", "truncated", "occluded", "alpha", "left", "top", "right", "bottom"),
    *("height", "width", "length", "x", "down", "y", "rotation"),
)
_LOOKED_AT = 100
_TYPE, _LEFT = _COLUMNS.index("class"), _COLUMNS.index("left")
_log = logging.getLogger(__name__)


def fits(begins: Beginning) -> bool:
    """Whether lines hold sixteen numbers and, as third field, a word; a score may follow."""
    rows = [line.split() for line in begins.lines[:_LOOKED_AT]]
    return bool(rows) and all(
        len(row) in (len(_COLUMNS), len(_COLUMNS) + 1)
        and row[_TYPE].replace("_", "").isalpha()
        and all(is_number(field) for at, field in enumerate(row) if at != _TYPE)
        for row in rows
    )


def read(path: Path, options: TableOptions) -> Trajectories:
    """Read the detections of people, frame of the camera.

    Raises:
        SourceError: a line is wrong, or nobody says the frame rate.
    """
    first = Beginning.of(path).lines[0].split()
    score = ("score",) if len(first) > len(_COLUMNS) else ()
    if float(first[_LEFT]) >= 0.0:
        text = "%s: positions are relative to the camera: if it moves, everybody seems to move with it"
        _log.warning(text, path)
    return read_table(path, replace(options, columns=(*_COLUMNS, *score)))
