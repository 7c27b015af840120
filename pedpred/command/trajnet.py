"""Predictions in the form of TrajNet++ (Kothari et al. 2021) as columns of a table of forecasts.

A line is `{"scene": {"id", "p", "s", "e", "fps"}}` or `{"track": {"f", "p", "x", "y", "prediction_number",
"scene_id"}}`. Each scene is about its pedestrian p; predictions of other pedestrians in it are left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pedpred.files import check_input
from pedpred.reading.errors import ContentError, add_path
from pedpred.reading.formats.trajnet import fields, json_lines, rate_of
from pedpred.storage.tracks import MOST_NUMBERS

_FIELDS = ("p", "f", "scene_id", "prediction_number", "x", "y")
_NAMES = ("track_id", "frame", "scene", "mode", "x", "y")
_RATES_HZ = (1e-6, 1e6)
_MOST_SCENES = MOST_NUMBERS // 20  # a scene in memory takes as much as 20 numbers of a table


def trajnet_columns(path: Path) -> tuple[dict[str, np.ndarray], float]:
    """Read predictions; their modes are equally likely.

    Returns:
        The columns of a table of forecasts, and the time between two steps, s.

    Raises:
        InputError: the file is missing or wrong, or holds no predictions.
    """
    check_input(path)
    with add_path(path):
        about: dict[int, tuple[int, float]] = {}
        rows: list[list[float]] = []
        for line, kind, content in json_lines(path):
            if kind == "scene":
                if len(about) == _MOST_SCENES:
                    raise ContentError(f"more than {_MOST_SCENES} scenes", "Divide the file", line)
                about[int(content["id"])] = int(content["p"]), rate_of(content)
            elif content.get("prediction_number") is not None:
                rows.append([line, *fields(content, _FIELDS, line)])
                if len(rows) * len(_FIELDS) > MOST_NUMBERS:
                    raise ContentError(
                        f"more than {MOST_NUMBERS // len(_FIELDS)} rows", "Divide the file", line
                    )
        if not rows:
            raise ContentError("no prediction: no track of a scene has a prediction_number")
        rates = {fps for _, fps in about.values()}
        if len(rates) != 1 or not _RATES_HZ[0] <= min(rates) <= _RATES_HZ[1]:
            remedy = "All must have the same one, a rate in 1/s"
            raise ContentError(f"fps of the scenes: {sorted(rates)[:5]}", remedy)
        step_s = 1.0 / rates.pop()
        return _in_steps(np.array(rows), {number: who for number, (who, _) in about.items()}, step_s), step_s


def _in_steps(rows: np.ndarray, primaries: Mapping[int, int], step_s: float) -> dict[str, np.ndarray]:
    """The predictions of the pedestrians that scenes are about, with times and steps in place of frames.

    Args:
        rows: line and `_FIELDS`. [M, 7]
        primaries: scene -> the pedestrian that it is about.
        step_s: time between two steps, s.

    Raises:
        ContentError: such a prediction has no position.
    """
    columns = dict(zip(("line", *_NAMES), rows.T, strict=True))
    scenes, scene = np.unique(columns.pop("scene"), return_inverse=True)
    primary = np.array([primaries.get(int(number), np.nan) for number in scenes])
    kept = primary[scene] == columns["track_id"]
    scene, columns = scene[kept], {name: values[kept] for name, values in columns.items()}
    lost = np.isnan(columns["x"]) | np.isnan(columns["y"])
    if lost.any():
        problem = "a prediction of the pedestrian that the scene is about has no position"
        raise ContentError(problem, "Remove the scene, or forecast it", int(columns["line"][lost][0]))
    frame = columns.pop("frame")
    order = np.lexsort((frame, columns["mode"], scene))
    steps = np.diff(frame[order])[(np.diff(scene[order]) == 0) & (np.diff(columns["mode"][order]) == 0)]
    apart = float(np.median(steps)) if len(steps) else 1.0  # scenes may lie between each other's frames
    first = np.full(len(scenes), np.inf)
    np.minimum.at(first, scene, frame)
    columns["track_id"] = columns["track_id"].astype(np.int64)
    columns["time"] = (first[scene] / apart - 1.0) * step_s
    columns["step"] = (frame - first[scene]) / apart + 1.0
    columns["weight"] = np.ones(len(frame))
    return columns
