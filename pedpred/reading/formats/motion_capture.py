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
    places = _places(str(path), about.get("BODY_NAMES", ()), form.titles)
    clock = next((title for title in ("Time", "Frame") if title in form.titles), None)
    used = dict.fromkeys(title for pairs in places.values() for pair in pairs for title in pair)
    table = read_columns(path, form, {title: title for title in [*used, *filter(None, [clock])]}, ())
    values = {title: table[title].to_numpy() for title in table.column_names}
    when = values[clock] if clock else np.arange(table.num_rows)
    _, first = np.unique(when, return_index=True)
    if len(first) < table.num_rows:
        _log.warning("%s: dropped %d repeated frames", path, table.num_rows - len(first))
    parts = []
    for body, pairs in places.items():
        seen = [np.stack([values[x][first], values[y][first]], -1) for x, y in pairs]
        best = max(seen, key=lambda position: int(_is_seen(position).sum()))
        rows = _is_seen(best)
        _log.info("%s: %s is seen in %d frames", path, body, rows.sum())
        x, y = best[rows].T
        parts.append(pa.table({"id": [body] * len(x), "when": when[first[rows]], "x": x, "y": y}))
    people = pa.concat_tables(parts)
    people = people.rename_columns(["id", "time" if clock == "Time" else "frame", "x", "y"])
    rate = next(iter(about.get("FREQUENCY", ())), "").replace(",", ".")
    return Table(people, "mm", float(rate) if rate and clock != "Time" else None)


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
        if not has_titles and (not fields[0] or fields[0].strip("-0123456789.,")):
            about[fields[0]] = [field for field in fields[1:] if field]
            continue
        skipped = number + has_titles
        first = lines[skipped].split(delimiter) if skipped < len(lines) else fields
        titles = fields if has_titles else _titles_of(about.get("MARKER_NAMES", ()), first)
        titles = [*titles, *[""] * len(first)][: len(first)]
        titles = [title or f"blank {at}" for at, title in enumerate(titles)]
        commas = delimiter != "," and any("," in field for field in first)
        decimal = "," if commas else options.decimal
        return about, TextForm(titles, delimiter, skipped, options.encoding, decimal)
    raise ContentError("no columns such as 'Helmet_1 - 1 X' and 'Helmet_1 - 1 Y'", _EXPORT)


def _titles_of(markers: Sequence[str], first: Sequence[str]) -> list[str]:
    """Titles of columns that have none: X, Y and Z of markers, perhaps after frame and time."""
    width = len(first) - (not first[-1].strip())
    titles = [f"{name} {axis}" for name in markers for axis in "XYZ"]
    if not markers or width < len(titles):
        raise ContentError(f"{width} columns, expected X, Y and Z of {len(markers)} markers", _EXPORT)
    return [*["Frame", "Time"][: width - len(titles)], *titles]


def _places(name: str, bodies: Sequence[str], titles: Sequence[str]) -> dict[str, list[tuple[str, str]]]:
    """Titles of x and y of every person: those of the centroid alone, or those of all markers."""
    found: dict[str, list[tuple[str, str]]] = {}
    for title in titles:
        match = _TITLE.fullmatch(title)
        other = f"{title[:-1]}Y"
        if match and title.endswith("X") and other in titles and (not bodies or match["body"] in bodies):
            found.setdefault(match["body"], []).append((title, other))
    if not found:
        raise ContentError("no columns such as 'Helmet_1 - 1 X' and 'Helmet_1 - 1 Y'", _EXPORT)
    people = [body for body in found if body.startswith(_PERSON)]
    if not people:
        _log.warning("%s: no body is called %s, so that each body or marker is a person", name, _PERSON)
    return {
        body: [pair for pair in found[body] if "Centroid" in pair[0]] or found[body]
        for body in people or found
    }


def _is_seen(position: np.ndarray) -> np.ndarray:
    """Whether a marker is seen: it is neither missing nor exactly at the origin. [F] bool."""
    return np.asarray(np.isfinite(position).all(axis=-1) & position.any(axis=-1))
