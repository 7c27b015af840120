"""Text files of PeTrack, JuPedSim and PedPy, which hold heads filmed in a laboratory, as a `Scene`.

    # framerate: 16
    # id frame x/m y/m z/m
    1 53 3.7253 -0.837 1.73

Lines that begin with `#` are comments. Lengths are metres unless one of the comments says `x/cm` or `in cm`.
Columns after the fourth are not used. `pedpred.sources.walls` reads the geometry that comes with the text.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.errors import SourceError, ValueRuleError
from pedpred.files import translate_errors
from pedpred.scenes import Scene, Trajectories
from pedpred.sources.text import numbers, text_rows, whole_number
from pedpred.sources.walls import UNITS, occupancy_of, read_walls

COLUMNS = ("id", "frame", "x", "y")
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
    rows: list[tuple[int, int, float, float]] = []
    seen: dict[tuple[int, int], int] = {}
    width = 0
    for line, fields in text_rows(path, "utf-8-sig"):
        if fields[0].startswith("#"):
            comments.append(" ".join(fields))
            continue
        width = width or len(fields)
        if len(fields) != width or width < len(COLUMNS):
            expected = f"{width} as before" if width >= len(COLUMNS) else f"{' '.join(COLUMNS)} and perhaps z"
            raise SourceError(path, line, f"{len(fields)} columns, expected {expected}")
        values = dict(zip(COLUMNS, numbers(path, line, fields[: len(COLUMNS)], COLUMNS), strict=True))
        key = whole_number(path, line, "id", values), whole_number(path, line, "frame", values)
        if key in seen:
            raise SourceError(path, line, f"id {key[0]} and frame {key[1]} again, first in line {seen[key]}")
        seen[key] = line
        rows.append((*key, values["x"], values["y"]))
    if not rows:
        raise SourceError(path, None, "no detections, the file is empty")
    rate_hz, unit_m = _frame_rate_hz(path, comments, frame_rate_hz), _unit_m(path, comments)
    track, frame, x, y = map(np.array, zip(*rows, strict=True))
    with translate_errors(partial(SourceError, path, None)):
        return Trajectories(frame / rate_hz, track, unit_m * np.stack([x, y], axis=-1))


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
