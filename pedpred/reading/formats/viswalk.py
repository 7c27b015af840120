"""Pedestrian records of PTV Viswalk (`.pp`): comments, then a header that begins with `$PEDESTRIAN:`.

$VISION
* File: station.inpx
$PEDESTRIAN:SIMSEC;NO;COORDCENTX;COORDCENTY
0.20;1;10.302;4.110
"""

from __future__ import annotations

from pathlib import Path

from pedpred.reading.errors import ContentError
from pedpred.reading.head import Head
from pedpred.reading.options import ReadOptions
from pedpred.reading.table import Table
from pedpred.reading.text import TextForm, first_lines, read_columns

NAME = "PTV Viswalk"
_HEADER, _MOST_LINES = "$PEDESTRIAN:", 1000
_WANTED = {"time": "SIMSEC", "id": "NO", "x": "COORDCENTX", "y": "COORDCENTY"}


def recognises(head: Head) -> bool:
    """Whether a file has such a header."""
    return any(line.startswith(_HEADER) for line in head.lines) or head.line.startswith("$VISION")


def read(path: Path, options: ReadOptions) -> Table:
    """Read the detections; lengths are metres unless `options` says otherwise.

    Raises:
        ContentError: there is no such header, or an attribute was not recorded.
    """
    lines = first_lines(path, _MOST_LINES, options.encoding)
    at = next((number for number, line in enumerate(lines) if line.startswith(_HEADER)), None)
    if at is None:
        raise ContentError(
            f"no line begins with {_HEADER}", "Record pedestrians, not vehicles, with titles in English"
        )
    titles = lines[at].removeprefix(_HEADER).strip().split(";")
    if missing := [title for title in _WANTED.values() if title not in titles]:
        problem = f"the attribute {missing[0]} was not recorded; there are {'; '.join(titles)[:200]}"
        raise ContentError(problem, f"Record {', '.join(_WANTED.values())}")
    form = TextForm(titles, ";", at + 1, options.encoding, options.decimal)
    return Table(read_columns(path, form, _WANTED), before=at + 1)
