"""Texts without titles: `id frame x y` or `frame id x y`, and perhaps z. How people move says which.

Separators, decimal commas, missing detections and copies are those of tables, see `pedpred.tables.reading`;
the frame rate and the unit of lengths those of comments, see `pedpred.tables.comments`.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError
from pedpred.files import translate_errors
from pedpred.scenes import Trajectories
from pedpred.sources.plausibility import ids_come_first
from pedpred.tables.comments import NO_RATE, frame_rate_hz, unit_of_lengths
from pedpred.tables.decimals import with_decimal_points
from pedpred.tables.detections import with_positions, without_copies
from pedpred.tables.ids import Ids
from pedpred.tables.lines import lines_of, of_width
from pedpred.tables.options import TableOptions
from pedpred.tables.reading import numbered
from pedpred.tables.text import OWN_FILE, read_numbers
from pedpred.tables.units import UNITS

COLUMNS = ("id", "frame", "x", "y")
_NAMES = ("track_id", "frame", "x_m", "y_m")
_REMEDY = "Name the columns in order, such as --columns time,id,x,y"
_log = logging.getLogger(__name__)


def read_untitled(path: Path, options: TableOptions) -> Trajectories:
    """Read the detections in a text without titles.

    Args:
        path: the file.
        options: rate and unit, if no comment says them.

    Raises:
        SourceError: the file is wrong; it names line and value. Or the order of its columns stays open.
    """
    lines = lines_of(path, header=False)
    line, first = next(lines.rows)
    if len(first) < len(COLUMNS):
        problem = f"{len(first)} columns, expected {' '.join(COLUMNS)} and perhaps z"
        remedy = "Separate values by blanks, tabs, commas or semicolons"
        raise SourceError(path, line, problem, remedy)
    titles = (*COLUMNS, "z", *(f"column_{n}" for n in range(6, len(first) + 1)))[: len(first)]
    rows = of_width(path, chain([(line, first)], lines.rows), titles)
    rows = with_decimal_points(path, with_positions(path, rows, (2, 3), 0), (2, 3), lines.separator)
    left, right = (Ids(path, title, _REMEDY) for title in COLUMNS[:2])
    rows = right.numbered(left.numbered(rows, 0), 1)
    columns = read_numbers(path, rows, titles, dict(zip(COLUMNS, _NAMES, strict=True)), OWN_FILE)
    unit = unit_of_lengths(path, lines.comments, options.unit) or "m"
    position = UNITS[unit] * np.stack([columns["x_m"], columns["y_m"]], axis=-1)
    order = "id, frame"
    if not _ids_first(path, (left, right), columns, position, titles):
        order, left, right = "frame, id", right, left
        columns["track_id"], columns["frame"] = columns["frame"], columns["track_id"]
    rate_hz = frame_rate_hz(path, lines.comments, options.rate_hz)
    if rate_hz is None:
        raise SourceError(path, None, *NO_RATE)
    columns |= {"time_s": _frames(right, columns.pop("frame")) / rate_hz, "x_m": position[:, 0]}
    columns |= {"track_id": numbered(left, columns["track_id"], options), "y_m": position[:, 1]}
    columns = without_copies(path, columns)
    _log.info("%s: each line is %s, x, y, as people move (%s, %g Hz)", path, order, unit, rate_hz)
    with translate_errors(partial(SourceError, path, None)):
        position = np.stack([columns["x_m"], columns["y_m"]], axis=-1)
        return Trajectories(columns["time_s"], columns["track_id"], position)


def _ids_first(
    path: Path,
    both: tuple[Ids, Ids],
    columns: Mapping[str, np.ndarray],
    position: np.ndarray,
    titles: Sequence[str],
) -> bool:
    """Whether ids come before frames; where that stays open, people are asked."""
    left, right = (ids.whole(columns[name]) for ids, name in zip(both, _NAMES, strict=False))
    if left is None or right is None:
        return right is not None
    found = ids_come_first(left, right, position)
    if found is None:
        one, other = (",".join([*order, *titles[2:]]) for order in (("id", "frame"), ("frame", "id")))
        problem = "without a header, the first two columns could be id and frame, or frame and id"
        raise SourceError(path, None, problem, f"Say which: --columns {one}, or --columns {other}")
    return found


def _frames(column: Ids, read: np.ndarray) -> np.ndarray:
    """The frame numbers that a column writes."""
    frames = column.whole(read)
    if frames is None:
        raise SourceError(column.path, None, "words in both of the first two columns", _REMEDY)
    return frames
