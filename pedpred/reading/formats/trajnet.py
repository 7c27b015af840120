"""Files of TrajNet++ (Kothari et al. 2021): a JSON object per line, of a scene or of a detection.

    {"scene": {"id": 0, "p": 1, "s": 0, "e": 120, "fps": 2.5}}
    {"track": {"f": 0, "p": 1, "x": 3.2, "y": -1.5}}

`f` is a frame, `p` a pedestrian, x and y are metres. `fps` of the scenes says how often people were
annotated: the usual number of frames between two detections of a track lasts 1 / fps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from pedpred.errors import brief
from pedpred.plain import parse_json
from pedpred.reading.errors import ContentError
from pedpred.reading.head import Head
from pedpred.reading.options import ReadOptions
from pedpred.reading.table import Table
from pedpred.reading.text import check_size, read_lines

NAME = "TrajNet++"
_LINE = '{"track": {"f": 0, "p": 1, "x": 0, "y": 0}}'
_OTHERS = "Is this a file of TrajNet++? Save others as CSV with the columns time,id,x,y"


def recognises(head: Head) -> bool:
    """Whether the first line is that of such a file."""
    return head.line.lstrip().replace(" ", "").startswith(('{"scene"', '{"track"'))


def read(path: Path, options: ReadOptions) -> Table:
    """Read the detections; `rate_hz` of the options is the number of frames per second, in place of `fps`.

    Raises:
        ContentError: a line is wrong, or a forecast; or the scenes have no `fps`, or several.
    """
    rates: set[float] = set()
    rows: list[list[float]] = []
    for line, kind, content in json_lines(path):
        if kind == "scene":
            if "fps" in content and len(rates) < 2:
                rates.add(rate_of(content))
            continue
        if content.get("prediction_number") is not None:
            remedy = "Measure forecasts with: pedpred evaluate RECORDING --forecasts FILE"
            raise ContentError("a forecast (prediction_number), but only detections are read", remedy, line)
        rows.append(fields(content, ("f", "p", "x", "y"), line))
        check_size(len(rows))
    if not rows:
        raise ContentError(f"no line with a track, such as {_LINE}", _OTHERS)
    values = np.array(rows)
    columns = dict(zip(("frame", "id", "x", "y"), values.T.copy(), strict=True))
    return Table(pa.table(columns), "m", options.rate_hz or _frames_per_second(values, rates))


def _frames_per_second(rows: np.ndarray, rates: set[float]) -> float:
    """The usual number of frames between two detections of a track, times `fps` of the scenes."""
    if len(rates) != 1 or not 0.0 < min(rates) < np.inf:
        named = ", ".join(f"{rate:g}" for rate in sorted(rates)) or "none"
        raise ContentError(f"fps of the scenes: {named}", "Give the frame rate: --rate")
    placed = rows[np.isfinite(rows).all(axis=1)]
    frame, who = placed[np.lexsort((placed[:, 0], placed[:, 1])), :2].T
    steps = np.diff(frame)[np.diff(who) == 0]
    return rates.pop() * (float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0)


def rate_of(scene: Mapping[str, Any]) -> float:
    """Frames per second of a scene; NaN where `fps` is null."""
    return math.nan if scene["fps"] is None else float(scene["fps"])


def json_lines(path: Path) -> Iterator[tuple[int, str, Mapping[str, Any]]]:
    """Yield line number, `scene` or `track`, and the object under it; other lines are passed over.

    Raises:
        ContentError: a line is no such object.
    """
    for line, text in enumerate(read_lines(path), start=1):
        if not text.strip():
            continue
        try:
            content = parse_json(text, missing=True)
        except (ValueError, RecursionError) as cause:
            raise ContentError(f"{cause}"[:300], line=line) from cause
        if not isinstance(content, dict):
            raise _no_object(content, line)
        for kind in ("scene", "track"):
            if (inner := content.get(kind)) is not None:
                if not isinstance(inner, dict):
                    raise _no_object(inner, line)
                yield line, kind, inner


def _no_object(value: object, line: int) -> ContentError:
    problem = f"{brief(value)} where an object is expected, as in {_LINE}"
    return ContentError(problem, "Is this a file of TrajNet++?", line)


def fields(content: Mapping[str, Any], names: tuple[str, ...], line: int) -> list[float]:
    """The numbers under some names; NaN where a value is null.

    Raises:
        ContentError: one is missing, no number, or a pedestrian's or a frame's is not whole.
    """
    values = []
    for name in names:
        if name not in content:
            raise ContentError(f"'{name}' is missing", line=line)
        value = content[name]
        if value is not None and type(value) not in (int, float):
            raise ContentError(f"{name} = {brief(value)} is not a number", line=line)
        number = math.nan if value is None else float(value)
        if name not in ("x", "y") and not number.is_integer():
            raise ContentError(f"{name} = {brief(value)}, must be a whole number", line=line)
        values.append(number)
    return values
