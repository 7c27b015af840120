"""Tables of tracks as text: a line per detection, columns named by a header or by the caller.

Separators are commas, semicolons, tabs or blanks; lines that begin with `#` are comments, unless they are the
header. Columns with other names than those of `NAMES` and of `Trajectories` are not used. Lengths are metres
unless the titles of x and y, such as `x [cm]` or `y_mm`, or the caller say otherwise. Ids may be words, which
are numbered.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

from pedpred.errors import SourceError, ValueRuleError
from pedpred.files import translate_errors
from pedpred.scenes import Trajectories
from pedpred.storage.tracks import tracks_of
from pedpred.tables.clocks import set_time
from pedpred.tables.ids import with_numbered_ids
from pedpred.tables.options import TableOptions
from pedpred.tables.text import Row, check_unique, is_number, read_numbers, text_lines
from pedpred.tables.titles import LENGTHS, titles_of_tracks, unit_of
from pedpred.tables.units import UNITS

_SEPARATORS = {";": "semicolons", "\t": "tabs", ",": "commas"}


def read_table(path: Path, options: TableOptions | None = None) -> Trajectories:
    """Read the detections in a table.

    Args:
        path: the file.
        options: what it does not say itself.

    Raises:
        SourceError: it is no such table; it names the line and the value, or what was found as header.
    """
    options = options or TableOptions()
    header, rows = _opened(path, options)
    return tracks_in_rows(path, header, rows, options)


def tracks_in_rows(
    path: Path, header: Sequence[str], rows: Iterator[Row], options: TableOptions
) -> Trajectories:
    """Read the detections in rows of text, from whatever file.

    Args:
        path: the file, for errors.
        header: titles of the columns, as a table has them.
        rows: the lines after the header.
        options: what they do not say themselves.

    Raises:
        SourceError: columns are missing, or a value is wrong; it names the line.
    """
    try:
        wanted = titles_of_tracks(header)
    except ValueRuleError as cause:
        raise SourceError(
            path, None, cause.rule, "Rename columns, or name all in order: --columns"
        ) from cause
    (id_title,) = (title for title, name in wanted.items() if name == "track_id")
    rows = with_numbered_ids(path, rows, header.index(id_title), [header.index(title) for title in wanted])
    columns = read_numbers(path, rows, header, wanted)
    for name in LENGTHS:
        columns[name] *= UNITS[unit_of(path, wanted, options.unit)]
    with translate_errors(lambda problem: SourceError(path, None, problem)):
        set_time(path, columns, options.rate_hz)
        check_unique(path, columns, "track_id", "time_s")
        del columns["line"]
        return tracks_of(columns, path)


def has_header(path: Path) -> bool:
    """Whether the first line that is no comment begins with a word.

    Raises:
        SourceError: the file is missing or no text.
    """
    first = next((text for _, text in text_lines(path) if not text.startswith("#")), "0")
    return not is_number(_split(first, _separator(first))[0])


def _opened(path: Path, options: TableOptions) -> tuple[Sequence[str], Iterator[Row]]:
    """Find the titles of the columns; the rows are read on demand."""
    lines = text_lines(path)
    for line, text in lines:
        separator = _separator(text)
        titles = [title.strip() for title in _split(text.lstrip("#"), separator)]
        if text.startswith("#") and (options.columns or not _names_tracks(titles)):
            continue
        is_header = not _holds_numbers(titles, options.columns)
        if not is_header and options.columns is None:
            problem = f"no header, the first line is {text.strip()[:80]!r}"
            raise SourceError(path, line, problem, "Name the columns in order, such as --columns time,id,x,y")
        given = lines if is_header else chain([(line, text)], lines)
        rows = ((n, _split(other, separator)) for n, other in given if not other.startswith("#"))
        return options.columns or titles, rows
    raise SourceError(path, None, "no detections, the file is empty")


def _holds_numbers(fields: Sequence[str], columns: Sequence[str] | None) -> bool:
    """Whether a line is no header: all its fields are numbers, or one in a column that the caller names."""
    if columns is None:
        return all(map(is_number, fields))
    return any(
        is_number(field)
        for title, field in zip(columns, fields, strict=False)
        if title in titles_of_tracks(columns)
    )


def _separator(text: str) -> str | None:
    return next((separator for separator in _SEPARATORS if separator in text), None)


def _split(text: str, separator: str | None) -> Sequence[str]:
    """Fields of a line; None: blanks separate them."""
    if '"' in text:
        return next(csv.reader([text], delimiter=separator or " ", skipinitialspace=True))
    return text.split(separator)


def _names_tracks(titles: Sequence[str]) -> bool:
    try:
        return bool(titles_of_tracks(titles))
    except ValueRuleError:
        return False
