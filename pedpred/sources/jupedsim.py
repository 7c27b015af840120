"""Text files of PeTrack, JuPedSim and PedPy, which hold heads filmed in a laboratory, as a `Scene`.

    # framerate: 16
    # id frame x/m y/m z/m
    1 53 3.7253 -0.837 1.73

Lines that begin with `#` are comments. Lengths are metres unless one of the comments says `x/cm` or `in cm`.
Columns after the fourth are not used. `pedpred.sources.walls` reads the geometry that comes with the text.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.errors import SourceError, ValueRuleError
from pedpred.files import translate_errors
from pedpred.scenes import Scene, Trajectories
from pedpred.sources.walls import UNITS, occupancy_of, read_walls
from pedpred.storage.text import Row, check_unique, read_numbers, text_rows

COLUMNS = ("id", "frame", "x", "y")
_NAMES = ("track_id", "frame", "x_m", "y_m")
_MOST_COMMENTS = 1000
_SLOWEST_HZ, _FASTEST_HZ = 1e-3, 1e6
_RATE = re.compile(r"(?:frame[ _-]?rate|fps)\W*(\d+(?:\.\d+)?)", re.IGNORECASE)
_UNIT = re.compile(r"(?:\bx */ *|\bin )(c|centi)?m", re.IGNORECASE)


def read_laboratory(folder: Path, name: str, settings: Mapping[str, Any]) -> Scene:
    """Read one recording and its geometry.

    Args:
        folder: holds <recording>.txt and <recording>.xml.
        name: name of the scene.
        settings: `recording`; `resolution_m`, `thickness_m`, `open_ends` and `open_end_m` of `occupancy_of`;
            `frame_rate_hz` if the text has none.

    Raises:
        SourceError: a file is missing or wrong; it names file, line and value.
        ValueRuleError: a setting is out of range.
    """
    for key in ("resolution_m", "thickness_m", "open_end_m", "frame_rate_hz"):
        if key in settings and not 0 < settings[key] < np.inf:
            raise ValueRuleError(key, settings[key], "it must be positive")
    path = folder / f"{settings['recording']}.txt"
    walls = read_walls(path.with_suffix(".xml"))
    map_settings = [settings[key] for key in ("resolution_m", "thickness_m", "open_ends", "open_end_m")]
    with translate_errors(partial(SourceError, path.with_suffix(".xml"), None)):
        occupancy = occupancy_of(walls, *map_settings)
    trajectories = read_tracks(path, settings.get("frame_rate_hz"))
    with translate_errors(partial(SourceError, path, None)):
        return Scene(name, trajectories, occupancy, trajectories.usual_interval_s())


def read_tracks(path: Path, frame_rate_hz: float | None = None) -> Trajectories:
    """Read the text alone.

    Args:
        path: the file.
        frame_rate_hz: needed if no comment has it.

    Raises:
        SourceError: the file is missing or wrong; it names line and value.
    """
    comments: list[str] = []
    rows = _without_comments(text_rows(path), comments)
    line, first = next(rows, (None, []))
    if line is None:
        raise SourceError(path, None, "no detections, the file is empty")
    if len(first) < len(COLUMNS):
        expected = f"expected {' '.join(COLUMNS)} and perhaps z"
        raise SourceError(path, line, f"{len(first)} columns, {expected}")
    titles = (*COLUMNS, "z", *(f"column_{n}" for n in range(6, len(first) + 1)))[: len(first)]
    wanted = dict(zip(COLUMNS, _NAMES, strict=True))
    columns = read_numbers(path, chain([(line, first)], rows), titles, wanted)
    check_unique(path, columns, "track_id", "frame")
    rate_hz, unit_m = _frame_rate_hz(path, comments, frame_rate_hz), _unit_m(path, comments)
    position = unit_m * np.stack([columns["x_m"], columns["y_m"]], axis=-1)
    with translate_errors(partial(SourceError, path, None)):
        return Trajectories(columns["frame"] / rate_hz, columns["track_id"], position)


def _without_comments(rows: Iterable[Row], comments: list[str]) -> Iterator[Row]:
    """Yield the rows, and collect what the comments say."""
    for line, fields in rows:
        if not fields[0].startswith("#"):
            yield line, fields
        elif len(comments) < _MOST_COMMENTS:
            comments.append(" ".join(fields))


def _frame_rate_hz(path: Path, comments: list[str], given: float | None) -> float:
    found = {float(match[1]) for comment in comments if (match := _RATE.search(comment))}
    rates = found | ({float(given)} if given else set())
    if not rates:
        remedy = "Say frame_rate_hz in the settings, or write a line `# framerate: 16` at the file's begin"
        raise SourceError(path, None, "no comment says the frame rate", remedy)
    if len(rates) > 1 or not _SLOWEST_HZ <= min(rates) <= _FASTEST_HZ:
        found_hz = " and ".join(f"{rate:g}" for rate in sorted(rates))
        raise SourceError(path, None, f"frame rate {found_hz} Hz, expected one from 0.001 to 1000000 Hz")
    return rates.pop()


def _unit_m(path: Path, comments: list[str]) -> float:
    units = {"cm" if match[1] else "m" for comment in comments for match in _UNIT.finditer(comment)}
    if len(units) > 1:
        raise SourceError(path, None, f"comments say both {' and '.join(sorted(units))}")
    return UNITS[units.pop()] if units else 1.0
