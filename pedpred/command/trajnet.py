"""Predictions in the form of TrajNet++ (Kothari et al. 2021) as a table of forecasts.

A line is `{"scene": {"id", "p", "s", "e", "fps"}}` or `{"track": {"f", "p", "x", "y", "prediction_number",
"scene_id"}}`. Each scene is about its pedestrian p; predictions of other pedestrians in it are left out.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from pedpred.files import check_input
from pedpred.reading.errors import ContentError, add_path
from pedpred.reading.formats.trajnet import fields, json_lines, rate_of
from pedpred.storage.tracks import MOST_NUMBERS

_FIELDS = ("p", "f", "scene_id", "prediction_number", "x", "y")
_NAMES = ("track", "frame", "scene", "mode", "x", "y")
_MOST_ROWS = MOST_NUMBERS // len(_FIELDS)


def read_trajnet_forecasts(path: Path) -> tuple[pd.DataFrame, float]:
    """Read predictions; their modes are equally likely.

    Returns:
        A table of forecasts, see `read_forecast_table`, and the time between two steps, s.

    Raises:
        InputError: the file is missing or wrong, or holds no predictions.
    """
    check_input(path)
    with add_path(path):
        primaries: dict[int, int] = {}
        rates_hz: set[float] = set()
        rows: list[list[float]] = []
        for line, kind, content in json_lines(path):
            if kind == "scene":
                primaries[int(content["id"])] = int(content["p"])
                rates_hz.add(rate_of(content))
            elif content.get("prediction_number") is not None:
                rows.append([*fields(content, _FIELDS, line)])
            if len(rows) + len(primaries) > _MOST_ROWS:
                raise ContentError(f"more than {_MOST_ROWS} lines", "Divide the file", line)
        if not rows:
            raise ContentError("no prediction: no track of a scene has a prediction_number")
        if len(rates_hz) != 1 or not 1e-6 <= min(rates_hz) <= 1e6:
            problem = f"fps of the scenes: {sorted(rates_hz)[:5]}"
            raise ContentError(problem, "All must have the same one, a rate in 1/s")
        step_s = 1.0 / rates_hz.pop()
        return _in_steps(pd.DataFrame(rows, columns=list(_NAMES), dtype=float), primaries, step_s), step_s


def _in_steps(rows: pd.DataFrame, primaries: dict[int, int], step_s: float) -> pd.DataFrame:
    """The predictions of the pedestrians that scenes are about, with times and steps in place of frames."""
    rows = rows[rows["track"] == rows["scene"].map(primaries)]
    if lost := int(rows[["x", "y"]].isna().any(axis=1).sum()):
        problem = f"{lost} predictions of pedestrians that scenes are about have no position"
        raise ContentError(problem, "Remove these scenes, or forecast them")
    rows = rows.sort_values(["scene", "mode", "frame"])
    spacing = rows.groupby(["scene", "mode"])["frame"].diff().median()
    spacing = 1.0 if pd.isna(spacing) else spacing
    first = rows.groupby("scene")["frame"].transform("min")
    return rows.assign(
        time=(first / spacing - 1.0) * step_s, step=(rows["frame"] - first) / spacing + 1.0, weight=1.0
    )
