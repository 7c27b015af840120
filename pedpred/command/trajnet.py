"""Predictions in the form of TrajNet++ (Kothari et al. 2021) as a table of forecasts.

A line is `{"scene": {"id", "p", "s", "e", "fps"}}` or `{"track": {"f", "p", "x", "y", "prediction_number",
"scene_id"}}`. Each scene is about its pedestrian p; predictions of other pedestrians in it are left out.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from pedpred.reading.errors import ContentError
from pedpred.storage.tracks import MOST_NUMBERS

_NAMES = {"p": "track", "f": "frame", "scene_id": "scene", "prediction_number": "mode", "x": "x", "y": "y"}
_MOST_LINES = MOST_NUMBERS // len(_NAMES)


def read_trajnet(path: Path) -> tuple[pd.DataFrame, float]:
    """Read predictions; their modes are equally likely.

    Returns:
        A table of forecasts, see `pedpred.command.forecast_tables`, and the time between two steps, s.

    Raises:
        ContentError: there are no predictions, scenes have no rate or several, or a position is missing.
    """
    lines = pd.read_json(path, lines=True, nrows=_MOST_LINES + 1)
    if len(lines) > _MOST_LINES:
        raise ContentError(f"more than {_MOST_LINES} lines", "Divide the file")
    scenes, tracks = (pd.DataFrame([*lines[kind].dropna()]) for kind in ("scene", "track"))
    rates_hz = scenes["fps"].unique()
    if len(rates_hz) != 1 or not rates_hz[0] > 0:
        raise ContentError(f"fps of the scenes: {rates_hz[:5]}", "All must have the same one, a rate in 1/s")
    if "prediction_number" not in tracks:
        raise ContentError("no prediction: no track of a scene has a prediction_number")
    rows = tracks[tracks["prediction_number"].notna()][[*_NAMES]].rename(columns=_NAMES).astype(float)
    rows = rows[rows["track"] == rows["scene"].map(scenes.set_index("id")["p"])]
    if rows.isna().any(axis=None):
        raise ContentError("a prediction of a pedestrian that a scene is about has no position")
    rows = rows.sort_values(["scene", "mode", "frame"])
    spacing = rows.groupby(["scene", "mode"])["frame"].diff().median()
    spacing = 1.0 if pd.isna(spacing) else spacing  # of predictions of one step
    ahead = (rows["frame"] - rows.groupby("scene")["frame"].transform("min")) / spacing
    step_s = 1.0 / float(rates_hz[0])
    made_s = (rows["frame"] / spacing - ahead - 1.0) * step_s
    return rows.assign(time=made_s, step=ahead + 1.0, weight=1.0), step_s
