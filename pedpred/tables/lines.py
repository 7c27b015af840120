"""Lines of a text with columns: comments, a header, and fields between separators.

Commas, semicolons, tabs, vertical bars or blanks separate fields; quotes hold fields together. Lines that
begin with `#`, `%` or `//` are comments, unless one is the header.
"""

from __future__ import annotations

import csv
import logging
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path

from pedpred.errors import SourceError, ValueRuleError
from pedpred.tables.columnar import columnar_lines, is_columnar
from pedpred.tables.comments import MOST_COMMENTS
from pedpred.tables.dates import is_time
from pedpred.tables.decimals import has_decimal_comma
from pedpred.tables.quotes import joined
from pedpred.tables.text import Row, check_width, is_number, text_lines
from pedpred.tables.titles import joined_titles, numbered_pairs, titles_of_fields, titles_of_tracks
from pedpred.tables.units import LENGTH_WORDS, TIME_WORDS

_SEPARATORS = (";", "\t", "|", ",")
_COMMENTS = ("#", "%", "//", "sep=")  # with the last, spreadsheets say the separator
_BLANKS = " \r\n"
"""Around the fields of a line; a tab may be the end of an empty one."""
_UTF8 = "Save it as text in UTF-8"
_MOST_ABOVE = 50
"""Lines above a header."""
_NO_UNIT = {"", "-", "--", "1", "none", "n/a", "m/s", "m/s2", "deg", "rad", "°", "id"}
_MOST_LEVELS = 3
"""Rows of a header."""
_MOST_NAMES = 2**17
"""Names of rows that are compared."""
_FEWEST = 3
"""Numbers that a row has at least, and one with decimal commas and blanks between them."""
_WIDTH = "Each line must have a value for each title, also where one is empty"
_ALL = "--columns names all columns in order, with any other word for those that are not used"
_COMMAS = "Where commas are decimal ones, separate values by semicolons"
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Lines:
    """A text with columns.

    Attributes:
        line: number of the first line that is not a comment, or of the header.
        begins: that line.
        separator: of that line; None: blanks.
        titles: of the columns; empty: the text has no header.
        rows: what follows, read on demand.
        comments: those that were met so far; all when the rows are read.
    """

    line: int
    begins: str
    separator: str | None
    titles: Sequence[str]
    rows: Iterator[Row]
    comments: Sequence[str]


def lines_of(path: Path, columns: Sequence[str] | None = None, header: bool = True) -> Lines:
    """Open a text.

    Args:
        path: the file.
        columns: titles, in place of those of a header.
        header: whether there may be one.

    Raises:
        SourceError: it is empty, or no text.
    """
    comments: list[str] = []
    lines = _lines(path, header, columns)
    for line, text in lines:
        comment = _is_comment(text)
        separator = _separator(text)
        titles = titles_in(text)
        if comment and (columns or not header or not _says_columns(titles)):
            if len(comments) < MOST_COMMENTS:
                comments.append(text.strip())
            continue
        has_titles = header and (comment or not _holds_numbers(titles, columns))
        rest = lines if has_titles else chain([(line, text)], lines)
        has_names, rest = _begins_with_names(text, rest, len(titles)) if has_titles else (False, rest)
        rows = _rows(path, rest, None if comment else separator, comment, comments, len(titles))
        named = columns or (titles if has_titles else ())
        if has_titles:
            if columns and _units_in(columns, titles):  # units in place of titles
                rows = chain([(line, titles)], rows)
            named, rows = _with_units(named, rows)
        if has_names and not columns:
            rows = _without_names(path, named, rows)
        elif has_titles and not columns:
            rows = rows if separator == "," else _without_numbers(named, rows)
        return Lines(line, text.strip(), separator, named, rows, comments)
    raise SourceError(path, None, "no detections, the file is empty", "Name a file with tracks")


def has_header(path: Path) -> bool:
    """Whether the first line that is not a comment has titles, or a comment before it has them.

    A line that begins with a word has titles if it holds no numbers, or names the columns of tracks.

    Raises:
        SourceError: the file is missing or no text.
    """
    widths = set()
    for _, text in _lines(path, True):
        separator = _separator(text)
        if not _is_comment(text):
            fields = _split(text, separator)
            words = not any(map(_is_numeric, fields)) or _names_tracks(titles_in(text))
            return (words and not _is_numeric(fields[0])) or len(fields) in widths
        if _says_columns(titles := titles_in(text)):
            widths = {len(titles)}
    return False


def of_width(
    path: Path, rows: Iterable[Row], titles: Sequence[str], by_caller: bool = False
) -> Iterator[Row]:
    """Check that each row has a field for each title; empty fields at the end may be there or not.

    A header that is repeated, as where files were joined, is left out, with a warning.

    Args:
        path: the file, for errors.
        rows: its lines.
        titles: of the columns.
        by_caller: whether the caller has named them, and may have named too few.

    Raises:
        SourceError: one has not; it names the line.
    """
    width, header = len(titles), [title.strip() for title in titles]
    again = []
    for count, (line, fields) in enumerate(rows):
        if len(fields) > width and not any(field.strip() for field in fields[width:]):
            fields = fields[:width]
        elif len(fields) == width - 1 and not titles[-1]:
            fields = [*fields, ""]
        if len(fields) != width:
            remedy = _ALL if by_caller and not count else _WIDTH
            check_width(path, line, fields, titles, f"{remedy}. {_COMMAS}" if len(fields) > width else remedy)
        if fields[0].strip() == header[0] and [field.strip() for field in fields] == header:
            again.append(line)
        else:
            yield line, fields
    if again:
        text = "%s: the header is repeated in line %d: if files of several recordings were joined, divide it"
        _log.warning(text, path, again[0])


def _lines(path: Path, header: bool, columns: Sequence[str] | None = None) -> Iterator[tuple[int, str]]:
    """Number and text of each line; what stands above a header, such as a program's name, is a comment."""
    lines = columnar_lines(path) if is_columnar(path) else joined(text_lines(path, _UTF8), _is_comment)
    if not header:
        return lines
    begin = list(islice(lines, _MOST_ABOVE))
    if columns is None and not any(_names_tracks(titles_in(text)) for _, text in begin):
        begin = _with_joined_titles(begin)
    above = _count_above([text for _, text in begin], columns)
    noted = [(line, text if _is_comment(text) else f"# {text}") for line, text in begin[:above]]
    return chain(noted, begin[above:], lines)


def _count_above(texts: Sequence[str], columns: Sequence[str] | None) -> int:
    """How many lines stand above the header, which is the last before rows where the caller names columns."""
    for at, text in enumerate(texts):
        titles = titles_in(text)
        if columns is None and _names_tracks(titles):
            return 0 if _is_comment(text) else at
        fewest = 1 if columns and len(titles) == len(columns) else _FEWEST
        if not _is_comment(text) and _count_values(titles, columns) >= fewest:
            return _begin_of_header(texts[:at], columns) if columns else 0
    return 0


def _with_joined_titles(begin: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """The lines with the rows of a header that name tracks together as one row, as pandas writes levels."""
    for at, (line, text) in enumerate(begin):
        separator = _separator(text)
        if _is_comment(text) or separator is None or _count_values(titles_in(text), None) >= _FEWEST:
            continue
        for rows in range(2, _MOST_LEVELS + 1):
            levels = [titles_in(text) for _, text in begin[at : at + rows]]
            if len(set(map(len, levels))) != 1 or _count_values(levels[-1], None):
                break
            titles = joined_titles(levels)
            if _says_columns(titles):
                quoted = (f'"{title.replace(chr(34), chr(34) * 2)}"' for title in titles)
                return [*begin[:at], (line, separator.join(quoted)), *begin[at + rows :]]
    return begin


def _begin_of_header(before: Sequence[str], columns: Sequence[str]) -> int:
    """Where titles, and units below them, begin at the end of lines; both have a field for each column."""
    begin = len(before)
    if before and _units_in(columns, titles_in(before[-1])):
        begin -= 1
    return begin - (begin > 0 and len(titles_in(before[begin - 1])) == len(columns))


def _count_values(fields: Sequence[str], columns: Sequence[str] | None) -> int:
    """How many fields are numbers; where the caller names the columns, of those that are used, and times."""
    if columns is None:
        return sum(map(_is_numeric, fields))
    used = titles_of_tracks(columns)
    named = [field for title, field in zip(columns, fields, strict=False) if title in used]
    return sum(_is_numeric(field) or is_time(field) for field in named)


def _with_units(titles: Sequence[str], rows: Iterator[Row]) -> tuple[Sequence[str], Iterator[Row]]:
    """Titles with the units in a row below them, if there is one, and the other rows."""
    first = next(rows, None)
    if first is None:
        return titles, rows
    named = _units_in(titles, first[1])
    if named is None:
        return titles, chain([first], rows)
    return (named if _names_tracks(named) else titles), rows


def _units_in(titles: Sequence[str], fields: Sequence[str]) -> list[str] | None:
    """Titles with the units in a row; None: it holds something else."""
    units = [field.strip().strip("[]()").lower() for field in fields]
    known = [unit in LENGTH_WORDS or unit in TIME_WORDS for unit in units]
    used = titles_of_tracks(titles) if _names_tracks(titles) else titles
    said = [
        (unit, is_known) for title, unit, is_known in zip(titles, units, known, strict=False) if title in used
    ]
    others = all(is_known or unit in _NO_UNIT for unit, is_known in said)
    if len(units) != len(titles) or not others or not any(is_known for _, is_known in said):
        return None
    return [
        f"{title} [{unit}]" if unit_known else title
        for title, unit, unit_known in zip(titles, units, known, strict=True)
    ]


def _begins_with_names(
    header: str, lines: Iterator[tuple[int, str]], width: int
) -> tuple[bool, Iterator[tuple[int, str]]]:
    """Whether the first row has a name before its values, as R writes it, all in quotes; and the lines."""
    first = next(lines, None)
    if first is None:
        return False, lines
    separator = _separator(first[1])
    quoted = first[1].startswith('"') and header.strip().startswith('"') and header.count('"') >= 2 * width
    named = quoted and len(_split(first[1], separator)) == width + 1 and bool(_split(first[1], separator)[-1])
    return named, chain([first], lines)


def _without_names(path: Path, titles: Sequence[str], rows: Iterator[Row]) -> Iterator[Row]:
    """Rows without their names, which all must have, and which differ.

    Raises:
        SourceError: a row has none, or one of another row; it names the line.
    """
    seen: set[str] = set()
    for line, fields in rows:
        check_width(path, line, fields, ["name of the row", *titles], _WIDTH)
        if fields[0] in seen:
            problem = f"{len(fields)} columns, expected {len(titles)}: {' '.join(titles)}"
            raise SourceError(path, line, problem, _WIDTH)
        if len(seen) < _MOST_NAMES:
            seen.add(fields[0])
        yield line, fields[1:]


def _without_numbers(titles: Sequence[str], rows: Iterator[Row]) -> Iterator[Row]:
    """Rows without a field that counts them from 0 or 1 and has no title, as R and pandas write it."""
    number = None
    for count, (line, fields) in enumerate(rows):
        if len(fields) == len(titles) + 1 and fields[-1].strip():
            if count == 0 and fields[0].strip() in ("0", "1"):
                number = int(fields[0])
            if number is not None and fields[0].strip() == str(number + count):
                fields = fields[1:]
        yield line, fields


def _rows(
    path: Path,
    lines: Iterable[tuple[int, str]],
    separator: str | None,
    titled: bool,
    comments: list[str],
    width: int,
) -> Iterator[Row]:
    """Fields of the lines; `titled`: the first row says how they are separated, and not the header.

    Comments that could be rows, as where ids begin with #, are warned about.
    """
    like_rows = []
    for line, text in lines:
        if _is_comment(text):
            fields = _split(text, _separator(text))
            if len(fields) == width and sum(map(_is_numeric, fields)) >= _FEWEST:
                like_rows.append(line)
            if len(comments) < MOST_COMMENTS:
                comments.append(text.strip())
            continue
        if titled:
            separator, titled = _separator(text), False
        yield line, _split(text, separator)
    if like_rows:
        text = "%s: %d rows, the first in line %d, begin with #, %% or //, and are left out as comments%s"
        _log.warning(text, path, len(like_rows), like_rows[0], ": if it belongs to ids, quote these")


def titles_in(text: str) -> list[str]:
    """Titles in a line; between blanks, a unit in brackets belongs to the title before it."""
    separator, plain = _separator(text), text.lstrip(_BLANKS).lstrip("#%/")
    joined = plain if separator else re.sub(r"\s+(?=[\[(])", "", plain)
    return titles_of_fields([title.strip() for title in _split(joined, separator)])


def _holds_numbers(fields: Sequence[str], columns: Sequence[str] | None) -> bool:
    """Whether a line is not a header: all its fields are numbers, or one in a column named by the caller."""
    if columns is None:
        return all(map(_is_numeric, fields))
    return any(
        _is_numeric(field)
        for title, field in zip(columns, fields, strict=False)
        if title in titles_of_tracks(columns)
    )


def _is_comment(text: str) -> bool:
    return text.lstrip().startswith(_COMMENTS)


def _is_numeric(field: str) -> bool:
    return is_number(field) or has_decimal_comma(field)


def _separator(text: str) -> str | None:
    """What separates the fields of a line; None: blanks, also where each comma is a decimal one."""
    first = next((separator for separator in _SEPARATORS if separator in text), None)
    if first == ",":
        fields = text.split()
        if len(fields) >= _FEWEST and all(map(_is_numeric, fields)):
            return None
    return first


def _split(text: str, separator: str | None) -> Sequence[str]:
    """Fields of a line; None: blanks separate them."""
    if '"' in text:
        plain = text.strip(_BLANKS if separator else None)
        return next(csv.reader([plain], delimiter=separator or " ", skipinitialspace=True))
    return text.split(separator)


def _says_columns(titles: Sequence[str]) -> bool:
    """Whether a comment has titles: those of tracks, or of columns of several people."""
    return _names_tracks(titles) or len(numbered_pairs(titles)) > 1


def _names_tracks(titles: Sequence[str]) -> bool:
    try:
        return bool(titles_of_tracks(titles))
    except ValueRuleError:
        return False
