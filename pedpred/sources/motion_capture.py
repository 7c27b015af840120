"""Motion capture: exports of QTM (.tsv), such as those of THOR, and tables of THOR-MAGNI (.csv).

A line is a frame; columns are markers in mm, called `Helmet_1 - 3 X`, or centroids of bodies, called
`Helmet_1 Centroid_X`. Where there are helmets, these are the people; otherwise every body is one. The place
of a body is its centroid, where the file has it, else its marker that is seen in most frames. Markers that
are not seen are blank or zero.
"""

from __future__ import annotations

import csv
import logging
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError
from pedpred.files import translate_errors
from pedpred.scenes import Trajectories
from pedpred.sources.beginnings import Beginning
from pedpred.sources.frames import agreed_rate
from pedpred.storage.tracks import MOST_NUMBERS
from pedpred.tables.decimals import has_decimal_comma, with_decimal_points
from pedpred.tables.missing import MISSING
from pedpred.tables.options import TableOptions
from pedpred.tables.text import Row, checked_rows, is_number, number, text_lines

_log = logging.getLogger(__name__)
_QTM, _MAGNI = "NO_OF_FRAMES", "FILE_ID"
_TITLE = re.compile(r"(?P<body>.+?)(?P<marker> - \d+ | Centroid_| )(?P<axis>[XY])")
_PERSON = "Helmet"
_MM = 1e-3
_EXPORT = "Export 3D data, with the names of markers"
_MOST_HEAD_LINES = 100


@dataclass(frozen=True)
class _Export:
    """An opened file: what is said above the data, their titles, and their lines."""

    about: Mapping[str, Sequence[str]]
    titles: Sequence[str]
    rows: Iterator[Row]


def fits(begins: Beginning) -> bool:
    """Whether a file begins as such an export does."""
    words = {re.split(r"[\t;,]", line, maxsplit=1)[0] for line in begins.lines[:_MOST_HEAD_LINES]}
    return begins.line().startswith((f"{_QTM}\t", f"{_QTM};")) or {_MAGNI, "BODY_NAMES"} <= words


def read(path: Path, options: TableOptions) -> Trajectories:
    """Read the people.

    Args:
        path: the file.
        options: `rate_hz` is needed where there are neither times nor FREQUENCY.

    Raises:
        SourceError: the file has no such columns, a line is wrong, or nobody is seen.
    """
    export = _opened(path)
    places = _places(path, export)
    used = sorted({column for pairs in places.values() for pair in pairs for column in pair})
    clock = [title for title in ("Time", "Frame") if title in export.titles][:1]
    lines, numbers = _values(path, export, [*map(export.titles.index, clock), *used])
    values = numbers[:, len(clock) :]
    if clock == ["Time"]:
        time_s = numbers[:, 0]
        if options.rate_hz is not None:
            _log.warning("%s: times are in column Time, so that --rate is not used", path)
    else:
        frame = numbers[:, 0] if clock else _frames_by_lines(export, lines)
        time_s = frame / _rate_hz(path, export, options)
    if not np.isfinite(time_s).all():
        raise SourceError(path, int(lines[~np.isfinite(time_s)][0]), "the time is missing")
    first = _first_frames(path, lines, time_s, values)
    parts = []
    for number_, (body, pairs) in enumerate(places.items()):
        seen = [values[first][:, [used.index(column) for column in pair]] for pair in pairs]
        best = max(seen, key=lambda position: int(_is_seen(position).sum()))
        rows = _is_seen(best)
        _log.info("%s: %s is person %d, seen in %d frames", path, body, number_ + 1, rows.sum())
        parts.append((time_s[first][rows], np.full(rows.sum(), number_ + 1), _MM * best[rows]))
    options.names.of_number.update(enumerate(places, start=1))
    with translate_errors(partial(SourceError, path, None)):
        return Trajectories(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _first_frames(path: Path, lines: np.ndarray, time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Rows of the first frame at each time, by time; some frames of THOR-MAGNI are there twice.

    Args:
        path: the file, for messages.
        lines: of the frames. [F]
        time_s: likewise. [F]
        values: likewise. [F, C]
    """
    _, first, which = np.unique(time_s, return_index=True, return_inverse=True)
    same = ((values == values[first[which]]) | np.isnan(values)).all(axis=-1)
    again = np.delete(np.arange(len(time_s)), first)
    for rows, what in (
        (again[same[again]], "frames that repeat another one are left out"),
        (again[~same[again]], "frames at the time of an earlier one, and with other values, are left out"),
    ):
        if len(rows):
            _log.warning("%s: %s: %d, the first in line %d", path, what, len(rows), lines[rows[0]])
    return first


def _frames_by_lines(export: _Export, lines: np.ndarray) -> np.ndarray:
    """Frames of lines without numbers; nothing is seen in blank lines, if the header says so many frames."""
    said = next(iter(export.about.get(_QTM, ())), "0")
    from_first = lines - lines[0]
    blank_count = is_number(said) and from_first[-1] < float(said)
    return from_first if blank_count else np.arange(len(lines))


def _opened(path: Path) -> _Export:
    """Read what is above the data.

    Raises:
        SourceError: there are no titles.
    """
    lines = text_lines(path)
    about: dict[str, Sequence[str]] = {}
    for line, text in lines:
        fields = _split(text)
        if any(_TITLE.fullmatch(field) for field in fields):
            titles = fields if fields[-1] else fields[:-1]
            return _Export(about, titles, _rows(lines, len(titles)))
        if _is_data(fields) or line > _MOST_HEAD_LINES:
            return _without_titles(path, about, (line, fields), lines)
        about[fields[0]] = [field for field in fields[1:] if field]
    raise SourceError(path, None, "no data below the header")


def _without_titles(
    path: Path, about: Mapping[str, Sequence[str]], first: Row, lines: Iterator[tuple[int, str]]
) -> _Export:
    """Name the columns of an export of QTM after its markers; frame and time may come before them."""
    names = about.get("MARKER_NAMES", ())
    titles = [f"{name} {axis}" for name in names for axis in "XYZ"]
    blank = next((n for n, field in enumerate(reversed(first[1])) if field), 0)
    fields = first[1][:-1] if blank % len("XYZ") == 1 else first[1]  # else the last marker is not seen
    before = {0: [], 1: ["Frame"], 2: ["Frame", "Time"]}.get(len(fields) - len(titles))
    if not names or before is None:
        problem = f"{len(fields)} columns, expected X, Y and Z of {len(names)} markers"
        raise SourceError(path, first[0], problem, _EXPORT)
    titles = [*before, *titles]
    return _Export(about, titles, chain([(first[0], fields)], _rows(lines, len(titles))))


def _rows(lines: Iterator[tuple[int, str]], width: int) -> Iterator[Row]:
    """Fields of the lines; a separator at the end of a line makes no field."""
    for line, text in lines:
        fields = _split(text)
        yield line, fields[:-1] if len(fields) == width + 1 and not fields[-1] else fields


def _split(text: str) -> list[str]:
    """Fields between tabs, semicolons or commas, the first of them that is there."""
    text = text.rstrip("\r\n")
    separator = next((sign for sign in "\t;" if sign in text), ",")
    fields = text.split("\t") if separator == "\t" else next(csv.reader([text], delimiter=separator), [""])
    return [field.strip() for field in fields]


def _is_data(fields: Sequence[str]) -> bool:
    """Whether fields are numbers, of which some may be missing, and not a name with its values."""
    said = [field for field in fields if field.lower() not in MISSING]
    return bool(said) and all(is_number(field) or has_decimal_comma(field) for field in said)


def _places(path: Path, export: _Export) -> dict[str, list[tuple[int, int]]]:
    """Columns of x and y of every person: those of the centroid alone, or those of all markers."""
    columns: dict[str, dict[str, dict[str, int]]] = {}
    known = export.about.get("BODY_NAMES", ())
    for column, title in enumerate(export.titles):
        if (match := _TITLE.fullmatch(title)) and (not known or match["body"] in known):
            columns.setdefault(match["body"], {}).setdefault(match["marker"], {})[match["axis"]] = column
    people = [body for body in columns if body.startswith(_PERSON)]
    if others := [body for body in columns if people and body not in people]:
        _log.info("%s: no people are %s", path, ", ".join(others)[:200])
    elif not people:
        _log.warning("%s: no body is called %s, so that each body or marker is a person", path, _PERSON)
    places = {}
    for body in people or columns:
        markers = {kind: axes for kind, axes in columns[body].items() if len(axes) == len("XY")}
        centroid = [axes for kind, axes in markers.items() if "Centroid" in kind]
        places[body] = [(axes["X"], axes["Y"]) for axes in centroid or markers.values()]
    if not any(places.values()):
        raise SourceError(path, None, "no columns such as 'Helmet_1 - 1 X' and 'Helmet_1 - 1 Y'", _EXPORT)
    return {body: pairs for body, pairs in places.items() if pairs}


def _values(path: Path, export: _Export, used: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Lines [F] and the numbers of some columns [F, C]; NaN where a field says nothing."""
    lines: list[int] = []
    values: list[np.ndarray] = []
    checked = checked_rows(path, export.rows, export.titles)
    for line, fields in with_decimal_points(path, checked, used, separator="\t"):
        if (len(values) + 1) * len(used) > MOST_NUMBERS:
            raise SourceError(path, line, f"more than {MOST_NUMBERS} numbers", "Divide the file")
        written = [fields[column] for column in used]
        numbers = [
            np.nan if field.lower() in MISSING else number(path, line, export.titles[column], field)
            for column, field in zip(used, written, strict=True)
        ]
        lines.append(line)
        values.append(np.array(numbers))
    if not values:
        raise SourceError(path, None, "no data below the header")
    return np.array(lines), np.array(values)


def _is_seen(position: np.ndarray) -> np.ndarray:
    """Whether a marker is seen: it is neither missing nor exactly at the origin. [F] bool."""
    return np.isfinite(position).all(axis=-1) & position.any(axis=-1)


def _rate_hz(path: Path, export: _Export, options: TableOptions) -> float:
    """The rate that the file or the caller says; errors of `agreed_rate`."""
    written = next(iter(export.about.get("FREQUENCY", ())), None)
    said = None if written is None else number(path, 1, "FREQUENCY", written.replace(",", "."))
    return agreed_rate(path, said, options, "neither times nor FREQUENCY", "FREQUENCY")
