"""Motion capture: exports of QTM (.tsv), such as those of THOR, and tables of THOR-MAGNI (.csv).

    NO_OF_FRAMES	20
    MARKER_NAMES	Helmet_1 - 1	Helmet_1 - 2
    Frame	Time	Helmet_1 - 1 X	Helmet_1 - 1 Y	Helmet_1 - 1 Z	...
    1	0.20000	1200.000	2000.000	1750.0	...

A line is a frame; columns are markers in mm, called `Helmet_1 - 3 X`, or centroids of bodies, called
`Helmet_1 Centroid_X`. Where there are helmets, these are the people; otherwise every body is one. The place
of a body is its centroid, where the file has it, else its marker that is seen in most frames. Markers that
are not seen are blank or zero.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa

from pedpred.reading.errors import ContentError
from pedpred.reading.head import Head
from pedpred.reading.options import ReadOptions
from pedpred.reading.table import Table
from pedpred.reading.text import TextForm, first_lines, read_columns

NAME = "motion capture (THÖR, THÖR-MAGNI, QTM)"
_TITLE = re.compile(r"(?P<body>.+?)(?P<marker> - \d+ | Centroid_| )(?P<axis>[XY])")
_PERSON, _MOST_HEAD_LINES = "Helmet", 100
_EXPORT = "Export 3D data, with the names of markers"
_log = logging.getLogger(__name__)


def recognises(head: Head) -> bool:
    """Whether a file begins as such an export does."""
    words = {re.split(r"[\t;,]", line, maxsplit=1)[0] for line in head.lines[:_MOST_HEAD_LINES]}
    return re.match(r"NO_OF_FRAMES[\t;]", head.line) is not None or {"FILE_ID", "BODY_NAMES"} <= words


def read(path: Path, options: ReadOptions) -> Table:
    """Read the people; `rate_hz` of the options is needed where there are neither times nor FREQUENCY.

    Raises:
        ContentError: the file has no such columns, or a value is wrong.
    """
    about, form = _head(path, options)
    places = _places(str(path), about, form.titles)
    clock = [title for title in ("Time", "Frame") if title in form.titles][:1]
    used = dict.fromkeys(title for pairs in places.values() for pair in pairs for title in pair)
    table = read_columns(path, form, {title: title for title in (*clock, *used)}, ())
    values = {title: table[title].to_numpy() for title in table.column_names}
    when = values[clock[0]] if clock else np.arange(table.num_rows, dtype=np.float64)
    first = _first_of_each(str(path), when)
    parts = []
    for body, pairs in places.items():
        seen = [np.stack([values[x][first], values[y][first]], -1) for x, y in pairs]
        best = max(seen, key=lambda position: int(_is_seen(position).sum()))
        rows = _is_seen(best)
        _log.info("%s: %s is seen in %d frames", path, body, rows.sum())
        parts.append((np.full(rows.sum(), body), when[first][rows], *best[rows].T))
    who, at, x, y = (np.concatenate(part) for part in zip(*parts, strict=True))
    written = next(iter(about.get("FREQUENCY", ())), "").replace(",", ".")
    rate_hz = None if clock == ["Time"] or not written else float(written)
    name = "time" if clock == ["Time"] else "frame"
    columns = {"id": pa.array(who.tolist(), pa.string()), name: at, "x": x, "y": y}
    return Table(pa.table(columns), "mm", rate_hz)


def _head(path: Path, options: ReadOptions) -> tuple[Mapping[str, Sequence[str]], TextForm]:
    """The lines above the data, and the form of the data; QTM may write them without titles.

    Raises:
        ContentError: there are no titles, and no markers have names.
    """
    about: dict[str, Sequence[str]] = {}
    lines = first_lines(path, _MOST_HEAD_LINES, options.encoding)
    for number, line in enumerate(lines):
        delimiter = next((sign for sign in "\t;" if sign in line), ",")
        fields = [field.strip().strip('"') for field in line.split(delimiter)]
        has_titles = any(_TITLE.fullmatch(field) for field in fields)
        if has_titles or (fields[0] and not fields[0].strip("-0123456789.,")):
            skipped = number + has_titles
            width = len(fields) - (not fields[-1])
            titles = fields if has_titles else _titles_of(about.get("MARKER_NAMES", ()), width)
            first = lines[skipped].split(delimiter) if skipped < len(lines) else fields
            titles = [*titles, *[""] * len(first)][: len(first)]
            titles = [title or f"blank {at}" for at, title in enumerate(titles)]
            commas = delimiter != "," and "," in "".join(first)
            decimal = "," if commas else options.decimal
            return about, TextForm(titles, delimiter, skipped, options.encoding, decimal)
        about[fields[0]] = [field for field in fields[1:] if field]
    raise ContentError("no columns such as 'Helmet_1 - 1 X' and 'Helmet_1 - 1 Y'", _EXPORT)


def _titles_of(markers: Sequence[str], width: int) -> list[str]:
    """Titles of columns that have none: X, Y and Z of markers, perhaps after frame and time."""
    titles = [f"{name} {axis}" for name in markers for axis in "XYZ"]
    before = ["Frame", "Time"][: max(0, min(2, width - len(titles)))]
    if not markers or width < len(titles):
        raise ContentError(f"{width} columns, expected X, Y and Z of {len(markers)} markers", _EXPORT)
    return [*before, *titles]


def _places(
    name: str, about: Mapping[str, Sequence[str]], titles: Sequence[str]
) -> dict[str, list[tuple[str, str]]]:
    """Titles of x and y of every person: those of the centroid alone, or those of all markers."""
    found: dict[str, dict[str, dict[str, str]]] = {}
    known = about.get("BODY_NAMES", ())
    for title in titles:
        if (match := _TITLE.fullmatch(title)) and (not known or match["body"] in known):
            found.setdefault(match["body"], {}).setdefault(match["marker"], {})[match["axis"]] = title
    people = [body for body in found if body.startswith(_PERSON)]
    if not people:
        _log.warning("%s: no body is called %s, so that each body or marker is a person", name, _PERSON)
    places = {}
    for body in people or found:
        markers = {kind: axes for kind, axes in found[body].items() if len(axes) == len("XY")}
        centroid = [axes for kind, axes in markers.items() if "Centroid" in kind]
        if pairs := [(axes["X"], axes["Y"]) for axes in centroid or markers.values()]:
            places[body] = pairs
    if not places:
        raise ContentError("no columns such as 'Helmet_1 - 1 X' and 'Helmet_1 - 1 Y'", _EXPORT)
    return places


def _first_of_each(name: str, clock: np.ndarray) -> np.ndarray:
    """Rows of the first frame at each time; some frames of THOR-MAGNI are there twice."""
    _, first = np.unique(clock, return_index=True)
    if len(first) < len(clock):
        _log.warning("%s: dropped %d frames at the time of an earlier one", name, len(clock) - len(first))
    return first


def _is_seen(position: np.ndarray) -> np.ndarray:
    """Whether a marker is seen: it is neither missing nor exactly at the origin. [F] bool."""
    return np.asarray(np.isfinite(position).all(axis=-1) & position.any(axis=-1))
