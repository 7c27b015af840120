"""Pedestrian records of PTV Viswalk (`.pp`): comments, then a header that begins with `$PEDESTRIAN:`.

$VISION
* File: station.inpx
$PEDESTRIAN:SIMSEC;NO;COORDCENTX;COORDCENTY
0.20;1;10.302;4.110
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path

from pedpred.errors import SourceError
from pedpred.scenes import Trajectories
from pedpred.sources.beginnings import Beginning
from pedpred.tables.options import TableOptions
from pedpred.tables.reading import tracks_in_rows
from pedpred.tables.text import Row, text_lines

_HEADER = "$PEDESTRIAN:"
_APART, _SHOWN = {"SIMRUN", "LEVEL"}, 3
"""Attributes that tell runs and floors apart, and how many values are told."""
_log = logging.getLogger(__name__)
_TITLES = {"SIMSEC": "time", "NO": "id", "COORDCENTX": "x", "COORDCENTY": "y"}


def fits(begins: Beginning) -> bool:
    """Whether a file has such a header."""
    return any(line.startswith(_HEADER) for line in begins.lines) or begins.line().startswith("$VISION")


def read(path: Path, options: TableOptions) -> Trajectories:
    """Read the detections; lengths are metres unless `unit` says otherwise.

    Raises:
        SourceError: an attribute was not recorded, or a line is wrong.
    """
    lines = text_lines(path)
    others: list[str] = []
    header = next((text.strip() for _, text in lines if _is_header(text, others)), None)
    if header is None:
        found = f", but with {', '.join(others)[:200]}" if others else ""
        problem = f"no line begins with {_HEADER}{found}"
        raise SourceError(path, None, problem, "Record pedestrians, not vehicles, with titles in English")
    recorded = header.removeprefix(_HEADER).split(";")
    if missing := [title for title in _TITLES if title not in recorded]:
        problem = f"the attribute {missing[0]} was not recorded; there are {'; '.join(recorded)[:200]}"
        raise SourceError(path, None, problem, f"Record {', '.join(_TITLES)}")
    titles = [_TITLES.get(title, f"${title}") for title in recorded]  # no other title can be mistaken
    apart = [at for at, title in enumerate(recorded) if title.partition("\\")[0] in _APART]
    seen: dict[int, set[str]] = {at: set() for at in apart}
    people = tracks_in_rows(path, titles, _watched(_rows(lines), seen), options)
    for at, values in seen.items():
        if len(values) > 1:
            shown = ", ".join(sorted(values)[:_SHOWN])
            text = "%s: %s is %s: all are read as one recording on one floor; divide the file"
            _log.warning(text, path, recorded[at], shown)
    return people


def _is_header(text: str, others: list[str]) -> bool:
    """Whether a line is the header of pedestrians; the beginnings of other headers are collected."""
    if text.startswith("$") and ":" in text and not text.startswith(_HEADER):
        others.append(text.partition(":")[0] + ":")
    return text.startswith(_HEADER)


def _watched(rows: Iterator[Row], seen: dict[int, set[str]]) -> Iterator[Row]:
    """Pass rows on, and collect some values of columns, by their place."""
    for line, fields in rows:
        for at, values in seen.items():
            if at < len(fields) and len(values) <= _SHOWN:
                values.add(fields[at])
        yield line, fields


def _rows(lines: Iterator[tuple[int, str]]) -> Iterator[Row]:
    for line, text in lines:
        if not text.startswith(("*", "$")):
            yield line, [field.strip() for field in text.split(";")]
