"""Files of TrajNet++ (Kothari et al. 2021): a JSON object per line, of a scene or of a detection.

    {"scene": {"id": 0, "p": 1, "s": 0, "e": 120, "fps": 2.5}}
    {"track": {"f": 0, "p": 1, "x": 3.2, "y": -1.5}}

`f` is a frame, `p` a pedestrian, x and y are metres. `fps` of the scenes says how often people were
annotated: the usual number of frames between two detections of a track lasts 1 / fps.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pyarrow as pa

from pedpred.reading.errors import ContentError
from pedpred.reading.head import Head
from pedpred.reading.options import ReadOptions
from pedpred.reading.table import Table
from pedpred.reading.text import check_size
from pedpred.storage.tracks import MOST_NUMBERS

NAME = "TrajNet++"
_COLUMNS = {"f": "frame", "p": "id", "x": "x", "y": "y"}
_OTHERS = "Is this a file of TrajNet++? Save others as CSV with the columns time,id,x,y"


def recognises(head: Head) -> bool:
    """Whether the first line is that of such a file."""
    return head.line.lstrip().replace(" ", "").startswith(('{"scene"', '{"track"'))


def read(path: Path, options: ReadOptions) -> Table:
    """Read the detections; `rate_hz` of the options is the number of frames per second, in place of `fps`.

    Raises:
        ContentError: a value is missing or no number, or a forecast; or scenes have no `fps`, or several.
    """
    lines = pd.read_json(path, lines=True, nrows=MOST_NUMBERS // 4 + 1, precise_float=True)
    check_size(len(lines))
    scenes, tracks = (pd.DataFrame([*lines.get(kind, pd.Series()).dropna()]) for kind in ("scene", "track"))
    if missing := [name for name in _COLUMNS if name not in tracks]:
        raise ContentError(f"no track has {missing[0]!r}", _OTHERS)
    if "prediction_number" in tracks and tracks["prediction_number"].notna().any():
        remedy = "Measure forecasts with: pedpred evaluate RECORDING --forecasts FILE"
        raise ContentError("forecasts (prediction_number), but only detections are read", remedy)
    rows = tracks[[*_COLUMNS]].rename(columns=_COLUMNS).astype(float)
    rate_hz = options.rate_hz or _frames_per_second(rows, scenes)
    return Table(pa.Table.from_pandas(rows, preserve_index=False), "m", rate_hz)


def _frames_per_second(rows: pd.DataFrame, scenes: pd.DataFrame) -> float:
    rates_hz = scenes.get("fps", pd.Series(dtype=float)).unique()
    if len(rates_hz) != 1 or not 0.0 < rates_hz[0] < float("inf"):
        raise ContentError(f"fps of the scenes: {rates_hz[:5]}", "Give the frame rate: --rate")
    steps = rows.dropna().sort_values(["id", "frame"]).groupby("id")["frame"].diff()
    usual = steps[steps > 0].median()
    return float(rates_hz[0]) * (1.0 if pd.isna(usual) else float(usual))
