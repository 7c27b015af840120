"""Predictions in the form of TrajNet++ (Kothari et al. 2021) as columns of a table of forecasts.

A line is `{"scene": {"id", "p", "s", "e", "fps"}}` or `{"track": {"f", "p", "x", "y", "prediction_number",
"scene_id"}}`. Each scene is about its pedestrian p; predictions of other pedestrians in it are left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.errors import SourceError
from pedpred.sources.trajnet import rate_of, track_rows
from pedpred.storage.tracks import MOST_NUMBERS
from pedpred.tables.text import read_numbers

_FIELDS = {
    "p": "track_id",
    "f": "frame",
    "scene_id": "scene",
    "prediction_number": "mode",
    "x": "x",
    "y": "y",
}
_RATES_HZ = (1e-6, 1e6)
_MOST_SCENES = MOST_NUMBERS // 20  # a scene in memory takes as much as 20 numbers of a table


def trajnet_columns(path: Path) -> tuple[dict[str, np.ndarray], float]:
    """Read predictions; their modes are equally likely.

    Returns:
        The columns of a table of forecasts, and the time between two steps, s.

    Raises:
        SourceError: the file is missing or wrong, or holds no predictions.
    """
    about: dict[int, tuple[int, float]] = {}
    nowhere: dict[tuple[int, int], int] = {}  # scene, pedestrian without a position -> first line

    def predicted(content: Any, line: int) -> Any:
        if "scene" in content:
            if len(about) == _MOST_SCENES:
                raise SourceError(path, line, f"more than {_MOST_SCENES} scenes", "Divide the file")
            scene = content["scene"]
            about[int(scene["id"])] = int(scene["p"]), rate_of(scene)
            return None
        track = content["track"]
        if track.get("prediction_number") is None:
            return None
        if track["x"] is not None and track["y"] is not None:
            return track
        if len(nowhere) == _MOST_SCENES:
            raise SourceError(
                path, line, f"more than {_MOST_SCENES} tracks without positions", "Divide the file"
            )
        nowhere.setdefault((int(track["scene_id"]), int(track["p"])), line)
        return None

    columns = read_numbers(path, track_rows(path, _FIELDS, predicted), tuple(_FIELDS), _FIELDS)
    if not len(columns["line"]):
        raise SourceError(path, None, "no prediction: no track of a scene has a prediction_number")
    if lost := [line for (scene, who), line in nowhere.items() if about.get(scene, (None,))[0] == who]:
        problem = "a prediction of the pedestrian that the scene is about has no position"
        raise SourceError(path, min(lost), problem, "Remove the scene, or forecast it")
    rates = {fps for _, fps in about.values()}
    if len(rates) != 1 or not _RATES_HZ[0] <= min(rates) <= _RATES_HZ[1]:
        raise SourceError(
            path, None, f"fps of the scenes: {sorted(rates)[:5]}", "All must have the same one, a rate in 1/s"
        )
    step_s = 1.0 / rates.pop()
    return _in_steps(columns, {number: who for number, (who, _) in about.items()}, step_s), step_s


def _in_steps(
    columns: dict[str, np.ndarray], primaries: Mapping[int, int], step_s: float
) -> dict[str, np.ndarray]:
    """The predictions of the pedestrians that scenes are about, with times and steps in place of frames.

    Args:
        columns: of `_FIELDS`, and `line`.
        primaries: scene -> the pedestrian that it is about.
        step_s: time between two steps, s.
    """
    scenes, scene = np.unique(columns.pop("scene"), return_inverse=True)
    primary = np.array([primaries.get(int(number)) for number in scenes], dtype=object)
    kept = primary[scene] == columns["track_id"]
    scene, columns = scene[kept], {name: values[kept] for name, values in columns.items()}
    frame = columns.pop("frame")
    order = np.lexsort((frame, columns["mode"], scene))
    steps = np.diff(frame[order])[(np.diff(scene[order]) == 0) & (np.diff(columns["mode"][order]) == 0)]
    apart = float(np.median(steps)) if len(steps) else 1.0  # scenes may lie between each other's frames
    first = np.full(len(scenes), np.inf)
    np.minimum.at(first, scene, frame)
    columns["time"] = (first[scene] / apart - 1.0) * step_s
    columns["step"] = (frame - first[scene]) / apart + 1.0
    columns["weight"] = np.ones(len(frame))
    return columns
