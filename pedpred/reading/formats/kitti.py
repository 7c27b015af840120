"""Labels of KITTI's tracking benchmark (Geiger et al., CVPR 2012), and AgentFormer's files in their form.

    0 2 Pedestrian 0 0 -2.52 1106.1 166.6 1204.5 323.9 1.75 0.77 0.85 6.99 1.6 8.37 -1.79

frame, id, type, truncated, occluded, alpha, box in the picture (4), height, width, length, x, y, z [m, camera
frame], rotation, perhaps a score; the ground has the axes x (right) and z (ahead).
"""

from __future__ import annotations

import logging
from pathlib import Path

from pedpred.reading.head import Head
from pedpred.reading.options import ReadOptions
from pedpred.reading.table import Table
from pedpred.reading.text import BLANKS, TextForm, read_columns

NAME = "KITTI tracking labels"
_TITLES = (
    *("frame", "id", "class", "truncated", "occluded", "alpha", "left", "top", "right", "bottom"),
    *("height", "width", "length", "x", "down", "y", "rotation", "score"),
)
_TYPE, _LEFT = _TITLES.index("class"), _TITLES.index("left")
_log = logging.getLogger(__name__)


def recognises(head: Head) -> bool:
    """Whether lines hold sixteen or seventeen numbers and, as third field, a word."""
    rows = [line.split() for line in head.lines[:100]]
    return bool(rows) and all(map(_is_label, rows))


def _is_label(row: list[str]) -> bool:
    if len(row) not in (len(_TITLES) - 1, len(_TITLES)) or not row[_TYPE].replace("_", "").isalpha():
        return False
    try:
        return all(float(field) is not None for at, field in enumerate(row) if at != _TYPE)
    except ValueError:
        return False


def read(path: Path, options: ReadOptions) -> Table:
    """Read the labels of all classes, frame of the camera."""
    first = Head.of(path).lines[0].split()
    if float(first[_LEFT]) >= 0.0:
        text = "%s: positions are relative to the camera: if it moves, all people seem to move"
        _log.warning(text, path)
    wanted = {name: name for name in ("frame", "id", "x", "y", "class")}
    return Table(read_columns(path, TextForm(_TITLES[: len(first)], BLANKS), wanted), "m", before=0)
