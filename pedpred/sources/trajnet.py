"""Files of TrajNet++ (Kothari et al. 2021): a JSON object per line, `{"track": {"f", "p", "x", "y"}}`.

`f` is a frame, `p` a pedestrian, x and y are metres. Lines `{"scene": {"fps", ...}}` say how often people
were annotated: the usual number of frames between two detections of a track lasts 1 / fps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.errors import SourceError, brief
from pedpred.files import translate_errors
from pedpred.plain import parse_json
from pedpred.scenes import Trajectories
from pedpred.sources.beginnings import Beginning
from pedpred.sources.frames import tracks_in_frames
from pedpred.tables.detections import with_positions
from pedpred.tables.options import TableOptions
from pedpred.tables.text import Row, read_numbers, text_lines

_FIELDS = {"f": "frame", "p": "track_id", "x": "x_m", "y": "y_m"}
_LINE = '{"track": {"f": 0, "p": 1, "x": 0, "y": 0}}'
_WHO, _PLACE = 1, (2, 3)
_OTHERS = "Is this a file of TrajNet++? Save others as CSV with the columns time,id,x,y"
_MEASURE = "Measure forecasts with: pedpred evaluate RECORDING --forecasts FILE"


def fits(begins: Beginning) -> bool:
    """Whether the name or the first line is that of such a file."""
    first = begins.line().lstrip()
    return begins.path.suffix == ".ndjson" or first.startswith(('{"scene"', '{"track"'))


def read_ndjson(path: Path, options: TableOptions | None = None) -> Trajectories:
    """Read the detections in a file of TrajNet++.

    Args:
        path: the file.
        options: its `rate_hz` is the number of frames per second, instead of `fps` of the scenes.

    Raises:
        SourceError: the file is missing or wrong, or holds forecasts; it names line and value.
    """
    rates: set[float] = set()

    def detected(content: Any, line: int) -> Any:
        track = content.get("track")
        if track is None:
            if "fps" in content.get("scene", {}) and len(rates) < 2:
                rates.add(rate_of(content["scene"]))
        elif track.get("prediction_number") is not None:
            raise SourceError(
                path, line, "a forecast (prediction_number), but only detections are read", _MEASURE
            )
        return track

    rows = with_positions(path, track_rows(path, _FIELDS, detected), _PLACE, _WHO)
    columns = read_numbers(path, rows, tuple(_FIELDS), _FIELDS)
    if not len(columns["line"]):
        raise SourceError(path, None, f"no line with a track, such as {_LINE}", _OTHERS)
    if options is not None and options.rate_hz is not None:
        return tracks_in_frames(path, columns, options.rate_hz)
    by_frame = tracks_in_frames(path, columns, rate_hz=1.0)
    if len(rates) != 1 or not 0.0 < min(rates) < np.inf:
        named = ", ".join(f"{rate:g}" for rate in sorted(rates)[:5]) or "none"
        remedy = "Say how many frames a second has: --rate"
        raise SourceError(path, None, f"fps of the scenes: {named}", remedy)
    with translate_errors(partial(SourceError, path, None)):
        rate_hz = by_frame.usual_interval_s() * rates.pop()
        return replace(by_frame, time_s=by_frame.time_s / rate_hz)


def rate_of(scene: Mapping[str, Any]) -> float:
    """Frames per second of a scene; NaN where it says none."""
    return math.nan if scene["fps"] is None else float(scene["fps"])


def track_rows(
    path: Path, names: Iterable[str], wanted: Callable[[Any, int], Mapping[str, Any] | None]
) -> Iterator[Row]:
    """Yield the fields of some of the tracks.

    Args:
        path: the file.
        names: of the fields.
        wanted: (content of a line, its number) -> its track, or None to pass over the line.

    Raises:
        SourceError: a line cannot be understood.
    """
    for line, text in text_lines(path):
        with translate_errors(partial(SourceError, path, line)):
            content = parse_json(text, missing=True)
            _check_object(path, line, content)
            track = wanted(content, line)
            fields = None if track is None else [_written(track[name]) for name in names]
        if fields is not None:
            yield line, fields


def _check_object(path: Path, line: int, content: Any) -> None:
    """Check that a line is an object, and what it says about a scene or a track, too.

    Raises:
        SourceError: it is not.
    """
    inner = [content.get(key, {}) for key in ("scene", "track")] if isinstance(content, dict) else [content]
    for value in inner:
        if not isinstance(value, dict | type(None)):
            problem = f"{brief(value)} where an object is expected, as in {_LINE}"
            raise SourceError(path, line, problem, "Is this a file of TrajNet++?")


def _written(value: Any) -> str:
    """Write a number as in a table, nothing if it is missing; anything else becomes what is not a number."""
    if value is None:
        return ""
    return repr(value) if type(value) in (int, float) else f"'{value}'"[:80]
