"""Tables of tracks as text: a line per detection, columns named by a header or by the caller.

`lines` finds the fields, `titles` what they mean, `classes` and `detections` which rows count; `ids`,
`decimals`, `dates`, `clocks` and `units` say what values mean. What was taken for what is logged.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import chain, islice
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError, ValueRuleError, worded
from pedpred.files import translate_errors
from pedpred.scenes import Trajectories
from pedpred.storage.tracks import tracks_of
from pedpred.tables.classes import (
    are_classes,
    classes_of_people,
    label_of,
    may_hold_classes,
    may_name_classes,
    people_by_ids,
)
from pedpred.tables.clocks import add_larger, add_rest, set_time
from pedpred.tables.comments import frame_rate_hz, unit_of_lengths
from pedpred.tables.dates import Dates, column_of_days
from pedpred.tables.decimals import with_decimal_points
from pedpred.tables.detections import (
    doubt_restarts,
    with_positions,
    without_copies,
    without_other_rows,
    without_untracked,
)
from pedpred.tables.fractions import check_fractions
from pedpred.tables.heights import Still, floors_apart
from pedpred.tables.ids import Ids
from pedpred.tables.lines import Lines, lines_of, of_width
from pedpred.tables.options import TableOptions
from pedpred.tables.pictures import on_ground
from pedpred.tables.text import OWN_FILE, OWN_VALUES, Row, read_numbers
from pedpred.tables.titles import (
    LARGER,
    LENGTHS,
    REST,
    columns_of_classes,
    columns_of_flags,
    columns_of_heights,
    columns_of_recordings,
    is_part_of_time,
    meaning_of,
    naming,
    numbered_pairs,
    other_pairs,
    sides_of_boxes,
    titles_of_tracks,
    unit_in,
)
from pedpred.tables.units import PIXELS, UNITS
from pedpred.tables.values import Values

_LONG = "Write a line per person and instant, with columns such as time,id,x,y"
_LONGEST_TITLES, _SHOWN_NAMES = 200, 3
LOOKED_AT = 1000
"""Rows that are looked at to find out what columns hold."""
_FEW_RECORDINGS, _MOST_RECORDINGS, _FEWEST_ROWS = 10, 500, 10
"""More values than the first count messages, unless each is in so many rows."""
_TRUTH = dict.fromkeys(("0", "0.0", "false", "f", "no"), False) | dict.fromkeys(
    ("1", "1.0", "true", "t", "yes"), True
)
_log = logging.getLogger(__name__)


def read_table(path: Path, options: TableOptions | None = None) -> Trajectories:
    """Read the detections in a table; rows without a position are missing ones.

    Args:
        path: the file.
        options: what it does not say itself.

    Raises:
        SourceError: it is not such a table; it names the line and the value, or what was found as header.
    """
    options = options or TableOptions()
    lines = lines_of(path, options.columns)
    if not lines.titles:
        raise SourceError(path, lines.line, f"no header, the first line is {lines.begins[:80]!r}", _named())
    _wanted(path, lines.titles)
    named = options.columns is not None

    def rows() -> Iterable[Row]:
        return of_width(path, lines_of(path, options.columns).rows, lines.titles, named)

    begin = list(islice(lines.rows, LOOKED_AT))
    chosen = people_in_rows(path, lines.titles, rows, options, begin)
    every = chain(begin, lines.rows)
    people = of_people(of_width(path, every, lines.titles, named), lines.titles, chosen)
    return _read(path, lines.titles, people, options, lines, chosen[0] if chosen else None)


def of_people(
    rows: Iterable[Row], titles: Sequence[str], chosen: tuple[str, set[str]] | None
) -> Iterable[Row]:
    """The rows of the classes in the column that `people_in_rows` found."""
    if chosen is None:
        return rows
    at, classes = titles.index(chosen[0]), chosen[1]
    return ((line, fields) for line, fields in rows if label_of(fields[at]) in classes)


def people_in_rows(
    path: Path,
    titles: Sequence[str],
    rows: Callable[[], Iterable[Row]],
    options: TableOptions,
    begin: Sequence[Row],
) -> tuple[str, set[str]] | None:
    """The column that says who is a person, by its title, by what it holds, or that of ids.

    See `classes_of_people`, `are_classes` and `people_by_ids`.

    Several recordings, and rows of people who were not seen, are warned about.

    Args:
        path: the file, for messages.
        titles: of the columns.
        rows: gives all rows, if any column has to be looked at.
        options: with the classes of people.
        begin: the first rows.
    """
    kinds, parts = columns_of_classes(titles), columns_of_recordings(titles)
    flags = columns_of_flags(titles)
    labels: dict[str, dict[str, set[str]]] = {title: {} for title in columns_of_labels(titles, begin)}
    who = next(title for title, name in titles_of_tracks(titles).items() if name == "track_id")
    ids = [who] if may_name_classes(_column(begin, titles.index(who))) else []
    counts: dict[str, Counter[str]] = {title: Counter() for title in (*kinds, *parts, *flags, *labels, *ids)}
    if counts:
        at = {title: titles.index(title) for title in (who, *counts)}
        for _, fields in rows():
            for title in counts:
                counts[title][label_of(fields[at[title]])] += 1
            for title, of_id in labels.items():
                of_id.setdefault(fields[at[who]], set()).add(label_of(fields[at[title]]))
    for title in parts:
        _doubt_one_recording(path, title, counts[title])
    for title, of_nobody in flags.items():
        _doubt_unseen(path, title, counts[title], of_nobody)
    wanted = options.classes
    kinds += [title for title, of_id in labels.items() if are_classes(path, title, of_id, wanted)]
    by_ids = partial(people_by_ids, path, who, counts[who], wanted) if ids else lambda: None
    if wanted and not kinds and (chosen := by_ids()):
        return chosen
    if kinds or wanted:
        chosen = classes_of_people(path, {title: counts[title] for title in kinds}, wanted)
        return chosen or by_ids()
    return by_ids()


def columns_of_labels(titles: Sequence[str], begin: Sequence[Row]) -> list[str]:
    """Titles of columns that are not used, and hold words for people or for others in the first rows."""
    used = {*titles_of_tracks(titles), *columns_of_classes(titles)}
    others = [(at, title) for at, title in enumerate(titles) if title not in used]
    return [title for at, title in others if may_hold_classes(_column(begin, at))]


def _column(rows: Iterable[Row], at: int) -> list[str]:
    """The different values of a column, without those of rows that are too short."""
    return list(dict.fromkeys(fields[at] for _, fields in rows if at < len(fields)))


def _doubt_one_recording(path: Path, title: str, counts: Counter[str]) -> None:
    """Warn if a column that tells recordings apart has several values, and not one for nearly every row."""
    values = sorted(set(counts) - {""})
    if 1 < len(values) <= max(_FEW_RECORDINGS, min(_MOST_RECORDINGS, counts.total() / _FEWEST_ROWS)):
        shown = ", ".join(values[:_SHOWN_NAMES]) + ", ..." * (len(values) > _SHOWN_NAMES)
        part = f"divide the {worded('file', 'table')} if they are several"
        text = f"%s: column %s holds %s: all are read as one recording on one ground; {part}"
        if is_part_of_time(title):
            text += ", or write one column of times if they are parts of these"
        _log.warning(text, path, title, shown)


def _doubt_unseen(path: Path, title: str, counts: Counter[str], of_nobody: bool) -> None:
    """Warn if a column of flags has the value of somebody who was not seen."""
    unseen = sum(count for value, count in counts.items() if _TRUTH.get(value.lower()) is of_nobody)
    if unseen:
        text = (
            "%s: column %s is %s in %d rows, which are read like others: remove them if they are about nobody"
        )
        _log.warning(text, path, title, of_nobody, unseen)


def tracks_in_rows(
    path: Path, header: Sequence[str], rows: Iterable[Row], options: TableOptions
) -> Trajectories:
    """Read the detections in rows of text, from whatever file; rows without a position are missing ones.

    Args:
        path: the file, for errors.
        header: titles of the columns, as a table has them.
        rows: the lines after the header.
        options: what they do not say themselves.

    Raises:
        SourceError: columns are missing, or a value is wrong; it names the line.
    """
    return _read(path, header, of_width(path, rows, header), options)


def _doubt_one_floor(path: Path, titles: Sequence[str], heights: Values, unit: str | None) -> None:
    """Warn if heights are those of several floors; their unit is that of x where no title says it."""
    for at, column in zip(heights.columns, heights.array(), strict=True):
        its_unit = unit_in(titles[at]) or unit or "m"
        if apart := floors_apart(column, UNITS.get(its_unit, 0.0)):
            text = "%s: column %s is up to %.4g or from %.4g: all are read as on one ground; %s"
            part = f"divide the {worded('file', 'table')} if these are floors"
            _log.warning(text, path, titles[at], *apart, part)


def _named(columns: str = "time,id,x,y") -> str:
    return f"Name all columns in order, such as {naming(columns)}"


def _read(
    path: Path,
    titles: Sequence[str],
    rows: Iterable[Row],
    options: TableOptions,
    lines: Lines | None = None,
    kind: str | None = None,
) -> Trajectories:
    """Read rows; without `lines`, those of a file that was parsed elsewhere. `kind` said who is a person."""
    comments = lines.comments if lines else ()
    wanted = _wanted(path, titles)
    _doubt_places(path, titles, wanted)
    at = {name: titles.index(title) for title, name in wanted.items()}
    ids = Ids(path, titles[at["track_id"]])
    clock = "time_s" if "time_s" in at else "frame"
    others = [column for name, column in at.items() if name not in (clock, REST, *LARGER)]
    rows = without_other_rows(path, rows, others)
    places = [at[name] for name in LENGTHS]
    rows = with_positions(path, rows, places, at["track_id"])
    still = Still(at["y_m"], [] if options.columns else columns_of_heights(titles), at["x_m"])
    days = column_of_days(titles)
    dates = Dates(path, titles[at[clock]], at[clock], days)
    numbers = [column for name, column in at.items() if not name.endswith("_id")]
    rows = with_decimal_points(path, rows, numbers, lines.separator if lines else None)
    heights = Values([] if options.columns else columns_of_heights(titles, ("z",)))
    rows = heights.watched(still.watched(dates.in_seconds(rows)))
    rows = ids.numbered(rows, at["track_id"], places)
    optional = set(at) - {clock, REST, "track_id", *LENGTHS}
    columns = read_numbers(path, rows, titles, wanted, OWN_FILE, optional)
    wanted = {title: name for title, name in wanted.items() if name in columns}
    columns[clock] = dates.with_days(columns[clock])
    units = _units(path, wanted, unit_of_lengths(path, comments, options))
    in_metres(path, columns, units, options)
    if moves := still.moving_column():
        problem = f"{titles[at['y_m']]} {moves[1]}, and {titles[moves[0]]} changes: y looks like a height"
        raise SourceError(path, None, problem, _named("time,id,x,height,y"))
    _doubt_one_floor(path, titles, heights, units["x_m"])
    units |= {clock: None if dates.read_dates else _said(titles[at[clock]])}
    with translate_errors(lambda problem: SourceError(path, None, problem, OWN_VALUES)):
        rate_hz = frame_rate_hz(path, comments, options.rate_hz) if clock == "frame" else None
        options.found.rate_hz = rate_hz
        if clock != "frame" and options.rate_hz:
            text = f"%s: times are in column %s, so that {worded('--rate', 'rate_hz')} is not used"
            _log.warning(text, path, titles[at[clock]])
        if REST in at and not add_rest(columns, _said(titles[at[REST]])):
            del wanted[titles[at[REST]]]
        larger = [name for name in LARGER if name in columns]
        if larger and not add_larger(columns):
            wanted = {title: name for title, name in wanted.items() if name not in larger}
        columns["track_id"] = numbered(ids, columns["track_id"], options)
        is_whole = REST not in at and not larger and units[clock] in (None, "s")
        if lines is not None and clock == "time_s" and is_whole:
            again = lines_of(path, options.columns).rows
            check_fractions(path, columns, ((line, fields[at[clock]]) for line, fields in again))
        set_time(path, columns, units[clock], rate_hz)
        doubt_restarts(path, columns)
        columns = without_copies(path, without_untracked(path, columns, options.names), options.names)
        if lines is not None:
            used = wanted | ({titles[days]: "date"} if days is not None and dates.read_days else {})
            used |= {kind: "class"} if kind and kind not in used else {}
            _tell(path, titles, used, units | {"frame": f"{rate_hz:g} Hz" if rate_hz else None})
        return tracks_of(columns, path)


def in_metres(
    path: Path, columns: dict[str, np.ndarray], units: Mapping[str, str | None], options: TableOptions
) -> None:
    """Bring x and y from their units, or from pixels, to metres.

    Args:
        path: the file, for errors.
        columns: with `line`, `x_m` and `y_m`, which are changed.
        units: of x and y; None: metres.
        options: where pixels lie on the ground; takes the unit that was found.

    Raises:
        SourceError: positions are pixels, and nobody says where these lie.
    """
    options.found.of_lengths = next((unit for name in LENGTHS if (unit := units[name])), None)
    if PIXELS in units.values():
        ground = on_ground(path, options, columns["x_m"], columns["y_m"], columns["line"])
        columns["x_m"], columns["y_m"] = ground.T.copy()
    else:
        for name in LENGTHS:
            columns[name] *= UNITS[units[name] or "m"]


def _wanted(path: Path, titles: Sequence[str]) -> dict[str, str]:
    """Title -> name of the columns that hold tracks."""
    try:
        return titles_of_tracks(titles)
    except ValueRuleError as cause:
        pairs = numbered_pairs(titles)
        is_axis = any((said := meaning_of(title)) and said.name in LENGTHS for title in titles)
        shown = " and ".join(", ".join(pair) for pair in pairs[:2])
        if again := _repeated_axes(titles):
            shown = f"{' and '.join(again)}, which are there several times,"
        elif len(pairs) < 2 or is_axis:
            remedy = f"Rename columns in the {worded('file', 'table')}. Or: {_named()}"
            raise SourceError(path, None, cause.rule, remedy) from cause
        problem = f"columns {shown} are those of several people, or corners of boxes"
        raise SourceError(path, None, problem, _LONG) from cause


def _doubt_places(path: Path, titles: Sequence[str], wanted: Mapping[str, str]) -> None:
    """Warn if other columns may hold the places of people."""
    used = " and ".join(title for name in LENGTHS for title, is_for in wanted.items() if is_for == name)
    for x, y in other_pairs(titles, wanted):
        text = "%s: columns %s are read as the places of people, and %s and %s are not: %s if these are meant"
        choose = worded("choose them by --columns", "leave out the others")
        _log.warning(text, path, used, x, y, choose)
    if {_said(title) for title, is_for in wanted.items() if is_for in LENGTHS} <= {None, PIXELS}:
        for width, height in sides_of_boxes(titles, wanted):
            text = "%s: columns %s are read as the places of people: if %s and %s are the sides of boxes, %s"
            middle = "write the middle of the lower edge of each box in their place"
            _log.warning(text, path, used, width, height, middle)


def _repeated_axes(titles: Sequence[str]) -> list[str]:
    """Titles of x and y, if each is that of several columns."""
    again = [title for title, count in Counter(titles).items() if count > 1]
    meant = {meaning.name: title for title in again if (meaning := meaning_of(title))}
    return [meant[name] for name in LENGTHS] if set(LENGTHS) <= set(meant) else []


def numbered(ids: Ids, column: np.ndarray, options: TableOptions) -> np.ndarray:
    """Ids as numbers; where these are not ids but places of words, the words become the tracks' names.

    Args:
        ids: of the file.
        column: what was read from them. [M] int64
        options: takes the names.

    Returns:
        [M] int64.
    """
    numbers, names = ids.of_tracks(column)
    if names:
        options.names.add(names)
        shown = ", ".join(f"{name} is {place}" for place, name in enumerate(names[:_SHOWN_NAMES]))
        more = ", ..." * (len(names) > _SHOWN_NAMES)
        _log.info("%s: ids are words, and numbered: %s%s", ids.path, shown, more)
    return numbers


def _said(title: str) -> str | None:
    """The unit in a title."""
    meaning = meaning_of(title)
    return meaning.unit if meaning else None


def _units(path: Path, wanted: Mapping[str, str], stated: str | None) -> dict[str, str | None]:
    """Units of x and y: those in their titles, or that of comments or the caller; None: metres.

    Raises:
        SourceError: they differ, or one has a unit and the other none.
    """
    titles = {name: title for title, name in wanted.items() if name in LENGTHS}
    said = {name: _said(title) for name, title in titles.items()}
    units = {unit for unit in said.values() if unit}
    if stated and units - {stated}:
        named = " and ".join(sorted(units | {stated}))
        remedy = worded("Correct titles, comments or --unit", "Correct titles or unit")
        raise SourceError(path, None, f"lengths are said to be {named}", remedy)
    if not stated and None in said.values() and units - {"m"}:
        bare = next(titles[name] for name, unit in said.items() if unit is None)
        other = next(title for title in titles.values() if title != bare)
        problem = f"column {other} has the unit {units.pop()}, column {bare} has none"
        raise SourceError(
            path, None, problem, f"Write the unit into both titles, or give {worded('--unit', 'unit')}"
        )
    return {name: unit or stated for name, unit in said.items()}


def _tell(
    path: Path, titles: Sequence[str], wanted: Mapping[str, str], units: Mapping[str, str | None]
) -> None:
    """Log which columns were read, in which units."""
    default = {"time_s": "s", "x_m": "m", "y_m": "m"}
    read = []
    for title, name in wanted.items():
        unit = units.get(name) or default.get(name)
        read.append(f"{name.removesuffix('_s').removesuffix('_m')} = {title}{f' ({unit})' if unit else ''}")
    others = [title or "(no title)" for title in titles if title not in wanted]
    unused = f"; not used: {', '.join(others)[:_LONGEST_TITLES]}" if others else ""
    _log.info("%s: columns %s%s", path, ", ".join(read), unused)
