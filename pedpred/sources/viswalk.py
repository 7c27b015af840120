"""Pedestrian records of PTV Viswalk (`.pp`): comments, then a header that begins with `$PEDESTRIAN:`.

$VISION
* File: station.inpx
$PEDESTRIAN:SIMSEC;NO;COORDCENTX;COORDCENTY
0.20;1;10.302;4.110
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pedpred.errors import SourceError
from pedpred.scenes import Trajectories
from pedpred.sources.beginnings import Beginning
from pedpred.tables.options import TableOptions
from pedpred.tables.reading import tracks_in_rows
from pedpred.tables.text import Row, text_lines

_HEADER = "$PEDESTRIAN:"
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
    header = next((text.strip() for _, text in lines if text.startswith(_HEADER)), None)
    if header is None:
        raise SourceError(path, None, f"no line begins with {_HEADER}", "Record pedestrians, not vehicles")
    recorded = header.removeprefix(_HEADER).split(";")
    if missing := [title for title in _TITLES if title not in recorded]:
        problem = f"the attribute {missing[0]} was not recorded; found were {'; '.join(recorded)[:200]}"
        raise SourceError(path, None, problem, f"Record {', '.join(_TITLES)}")
    titles = [_TITLES.get(title, f"${title}") for title in recorded]  # no other title can be mistaken
    return tracks_in_rows(path, titles, _rows(lines), options)


def _rows(lines: Iterator[tuple[int, str]]) -> Iterator[Row]:
    for line, text in lines:
        if not text.startswith(("*", "$")):
            yield line, [field.strip() for field in text.split(";")]
