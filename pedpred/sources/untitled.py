"""Texts without titles: id, frame or time, x, y and perhaps z; frame or time may come first.

Numbers with fractions are times, s; else how people move says which column holds ids.

Separators, decimal commas, missing detections and copies are those of tables, see `pedpred.tables.reading`;
the frame rate and the unit of lengths those of comments, see `pedpred.tables.comments`.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import chain, islice, pairwise
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError
from pedpred.files import translate_errors
from pedpred.scenes import Trajectories
from pedpred.sources.axes import misplaced_axis
from pedpred.sources.plausibility import check_places, ids_come_first
from pedpred.storage.tracks import tracks_of
from pedpred.tables.clocks import set_time
from pedpred.tables.comments import NO_RATE, frame_rate_hz, unit_of_lengths
from pedpred.tables.dates import is_time
from pedpred.tables.decimals import with_decimal_points
from pedpred.tables.detections import doubt_restarts, with_positions, without_copies, without_untracked
from pedpred.tables.fractions import check_fractions
from pedpred.tables.heights import Still
from pedpred.tables.ids import Ids
from pedpred.tables.lines import lines_of, of_width
from pedpred.tables.options import TableOptions
from pedpred.tables.reading import in_metres, numbered
from pedpred.tables.text import OWN_FILE, OWN_VALUES, Row, is_number, read_numbers
from pedpred.tables.titles import LENGTHS
from pedpred.tables.units import PIXELS
from pedpred.tables.values import Values

COLUMNS = ("id", "frame", "x", "y")
_NAMES = ("track_id", "frame", "x_m", "y_m")
_Y = COLUMNS.index("y")
_REMEDY = "Name the columns in order, such as --columns time,id,x,y"
_IN_ORDER = f"{_REMEDY}, with any other word for columns that are not used"
_WRONG = f"{OWN_FILE}. Or, if columns hold something else: {_REMEDY}"
_BOXES = (
    "Write the middle of the lower edge of each box into a table with the columns frame,id,x_px,y_px, "
    "and give --homography H.txt, or --scale"
)
_BOX_ON_GROUND = ("frame", "id", "left", "top", "width", "height", "confidence", "x", "y", "z")
_BOXES_ON_GROUND = f"Name the columns in order: --columns {','.join(_BOX_ON_GROUND)}"
_NARROWEST_PX = 10.0
_LOOKED_AT, _FEWEST_ROWS = 200, 3
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
    rows = _without_row_numbers(path, lines.rows)
    line, first = next(rows)
    _check_columns(path, line, first)
    titles = (*COLUMNS, "z", *(f"column_{n}" for n in range(6, len(first) + 1)))[: len(first)]
    still = Still(_Y, range(_Y + 1, len(first)))
    rows = of_width(path, chain([(line, first)], rows), titles)
    rows = still.watched(with_positions(path, rows, (2, 3), 0))
    rows = with_decimal_points(path, rows, range(len(COLUMNS)), lines.separator)
    both = Ids(path, COLUMNS[0], _REMEDY), Ids(path, COLUMNS[1], _REMEDY)
    values_of = Values(range(len(COLUMNS), len(first)))
    rows = values_of.watched(both[1].numbered(both[0].numbered(rows, 0), 1))
    columns = read_numbers(path, rows, titles, dict(zip(COLUMNS, _NAMES, strict=True)), _WRONG)
    if moves := still.moving_column():
        problem = f"without a header, column {_Y + 1} should be y, but it {moves[1]}"
        raise SourceError(path, None, problem, _IN_ORDER)
    written = np.stack([columns[name] for name in LENGTHS])
    unit = unit_of_lengths(path, lines.comments, options)
    if unit == PIXELS and len(titles) > len(COLUMNS):
        problem = f"without a header, {len(titles)} columns in pixels may be those of boxes"
        raise SourceError(path, line, problem, _REMEDY.replace("time", "frame"))
    in_metres(path, columns, dict.fromkeys(LENGTHS, unit), options)
    read = [(ids, columns.pop(name)) for ids, name in zip(both, _NAMES, strict=False)]
    fractions = [ids.holds_fractions() for ids in both]
    ids_first = fractions[1] if any(fractions) else _ids_first(path, read, columns, titles)
    (who, whose), (clock, when) = read if ids_first else read[::-1]
    columns["track_id"] = numbered(who, whose, options)
    if any(fractions):
        order, clock_is, rate_hz = ("id", "time"), "s", None
        columns["time_s"] = clock.written(when)
        again = _without_row_numbers(path, lines_of(path, header=False).rows)
        check_fractions(path, columns, ((line, fields[int(ids_first)]) for line, fields in again))
    else:
        rate_hz = frame_rate_hz(path, lines.comments, options.rate_hz)
        if rate_hz is None:
            raise SourceError(path, None, *NO_RATE)
        order, clock_is, options.found.rate_hz = ("id", "frame"), f"{rate_hz:g} Hz", rate_hz
        columns["frame"] = _frames(clock, when)
    set_time(path, columns, None, rate_hz)
    _check_axes(path, still, written, values_of.array(), columns)
    doubt_restarts(path, columns)
    columns = without_copies(path, without_untracked(path, columns, options.names), options.names)
    shown = ", ".join(order if ids_first else order[::-1])
    _log.info("%s: each line is %s, x, y, as people move (%s, %s)", path, shown, unit or "m", clock_is)
    with translate_errors(partial(SourceError, path, None, remedy=OWN_VALUES)):
        people = tracks_of(columns, path)
    check_places(path, people, _REMEDY)
    return people


def _check_columns(path: Path, line: int, fields: Sequence[str]) -> None:
    """Check that a line may be one of id, frame, x and y.

    Raises:
        SourceError: it has too few columns, dates, or a box in a picture.
    """
    if len(fields) < len(COLUMNS):
        problem = f"no header, and {len(fields)} columns, expected {' '.join(COLUMNS)} and perhaps z"
        remedy = "Separate values by blanks, tabs, commas or semicolons"
        raise SourceError(path, line, problem, remedy)
    if dates := [k for k in (0, 1) if is_time(fields[k])]:
        problem = f"no header, and {fields[dates[0]]!r} is a time, not a number of frames or seconds"
        raise SourceError(path, line, problem, _REMEDY)
    if _is_box_on_ground(fields):
        problem = "these look like boxes of MOTChallenge in pixels, and behind them x, y and z on the ground"
        raise SourceError(path, line, problem, _BOXES_ON_GROUND)
    if _is_box(fields):
        problem = "these look like boxes of MOTChallenge: frame, id, left, top, width, height in pixels"
        raise SourceError(path, line, problem, _BOXES)


def _check_axes(
    path: Path, still: Still, written: np.ndarray, others: np.ndarray, columns: Mapping[str, np.ndarray]
) -> None:
    """Check that people move along what is taken as x and y, in the unit of the file [2, M], as people do.

    Raises:
        SourceError: x is something else, or another column [K, M] is one of the two.
    """
    keys = columns["track_id"], columns["time_s"]
    if still.others_change() and (cause := _other_than_x(written[0], *keys)):
        raise SourceError(path, None, f"without a header, column 3 should be x, but it {cause}", _IN_ORDER)
    if misplaced := misplaced_axis(written, others, *keys):
        taken, other = misplaced[0] + COLUMNS.index("x"), misplaced[1] + len(COLUMNS)
        problem = f"without a header, column {taken + 1} should be {COLUMNS[taken]}, but people hardly move "
        problem += f"along it, and they do along column {other + 1}"
        raise SourceError(path, None, problem, _IN_ORDER)


def _is_box(fields: Sequence[str]) -> bool:
    """Whether a line is one of MOTChallenge: a box, and behind it -1 three times, or class and visibility.

    VisDrone has class, truncation and occlusion there.
    """
    if len(fields) not in (9, 10) or not all(map(is_number, fields)):
        return False
    _, _, _, _, width, height, sure, *rest = map(float, fields)
    ends = (
        rest == [-1] * 3
        or (len(fields) == 10 and _are_kinds(fields[-3:]))
        or (len(rest) == 2 and sure in (0, 1) and rest[0].is_integer() and 0 <= rest[1] <= 1)
    )
    return ends and min(width, height) > 1


def _are_kinds(fields: Sequence[str]) -> bool:
    """Whether three fields are a class, and how much of a box is cut off and hidden, as VisDrone has them."""
    kind, *shares = (field.strip() for field in fields)
    return kind.isdecimal() and int(kind) <= 11 and set(shares) <= {"0", "1", "2"}


def _is_box_on_ground(fields: Sequence[str]) -> bool:
    """Whether a line is a box that is higher than wide, a confidence, and a place on the ground."""
    if len(fields) != len(_BOX_ON_GROUND) or not all(map(is_number, fields)):
        return False
    _, _, _, _, width, height, sure, *place = map(float, fields)
    is_place = place != [-1] * 3 and not _are_kinds(fields[-3:])
    return height > width >= _NARROWEST_PX and abs(sure) <= 1 and is_place


def _without_row_numbers(path: Path, rows: Iterator[Row]) -> Iterator[Row]:
    """The rows without a first column that numbers them, before id and frame, as pandas writes it."""
    first = list(islice(rows, _LOOKED_AT))
    columns = list(zip(*(fields for _, fields in first), strict=False))[: len(COLUMNS) + 1]
    every = chain(first, rows)
    if not _numbers_rows(columns):
        return every
    _log.info("%s: the first column numbers the rows, and is not used", path)
    return ((line, fields[1:]) for line, fields in every)


def _numbers_rows(columns: Sequence[Sequence[str]]) -> bool:
    """Whether columns are a number that rises from row to row, two of whole numbers, and two of others."""
    if len(columns) <= len(COLUMNS) or len(columns[0]) < _FEWEST_ROWS:
        return False
    if not all(is_number(field) for column in columns for field in column):
        return False
    number, *whole, x, y = ([float(field) for field in column] for column in columns)
    rises = all(later > earlier for earlier, later in pairwise(number))
    are_whole = [all(value.is_integer() for value in column) for column in (number, *whole, x, y)]
    return rises and are_whole == [True, True, True, False, False]


def _ids_first(
    path: Path,
    read: Sequence[tuple[Ids, np.ndarray]],
    columns: Mapping[str, np.ndarray],
    titles: Sequence[str],
) -> bool:
    """Whether ids come before frames; where that stays open, people are asked."""
    left, right = (ids.whole(written) for ids, written in read)
    if left is None or right is None:
        return right is not None
    ids_first = ids_come_first(left, right, np.stack([columns[name] for name in LENGTHS], axis=-1))
    if ids_first is None:
        one, other = (",".join([*order, *titles[2:]]) for order in (("id", "frame"), ("frame", "id")))
        problem = "without a header, the first two columns could be id and frame, or frame and id"
        raise SourceError(path, None, problem, f"Say which: --columns {one}, or --columns {other}")
    return ids_first


def _other_than_x(x: np.ndarray, track_id: np.ndarray, time_s: np.ndarray) -> str | None:
    """What speaks against a column being x; None: nothing."""
    if _depends_on(track_id, x) and (x == np.round(x)).all():
        return "is a whole number that stays with everybody, as a class does"
    if _depends_on(time_s, x):
        return "is the same for all people at once, as a time is"
    return None


def _depends_on(key: np.ndarray, values: np.ndarray) -> bool:
    """Whether keys are there several times, always with the same value."""
    order = np.argsort(key, kind="stable")
    again = np.diff(key[order]) == 0
    return bool(again.sum() >= _FEWEST_ROWS and not np.diff(values[order])[again].any())


def _frames(column: Ids, read: np.ndarray) -> np.ndarray:
    """The frame numbers that a column writes."""
    frames = column.whole(read)
    if frames is None:
        raise SourceError(column.path, None, "words in both of the first two columns", _REMEDY)
    return frames
