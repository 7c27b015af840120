"""Forecasts of other programs, from tables or TrajNet++, as a forecaster for the windows that they cover."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from pedpred.command.forecast_tables import read_forecast_table
from pedpred.command.trajnet import read_trajnet
from pedpred.errors import InputError, ValueRuleError
from pedpred.files import check_input
from pedpred.forecasting import ForecastRequest
from pedpred.reading.checks import FASTEST_MPS
from pedpred.reading.errors import ContentError, add_path
from pedpred.reading.names import TrackNames, number_ids
from pedpred.ros import Transform
from pedpred.scenes import Predictions

_SAME_S = 0.005
_SAME = "Ids and times must be those of the recording"
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ForeignForecasts:
    """Forecasts of some people at some instants, world frame; a forecaster for the windows that they cover.

    Attributes:
        source: the file.
        track_id: of the person, in the recording. [F]
        time_s: when each was made, s. [F]
        path: modes, the most likely first, m. [F, K, S, 2]
        weight: of the modes. [F, K]
        step_s: time between two steps, s; None: that of the windows.
    """

    source: Path
    track_id: np.ndarray
    time_s: np.ndarray
    path: np.ndarray
    weight: np.ndarray
    step_s: float | None

    def to_map(self, transform: Transform) -> ForeignForecasts:
        """Transform forecasts from the frame of the people to that of the map."""
        return replace(self, path=transform.to_map(self.path))

    def has_forecast(self, request: ForecastRequest) -> np.ndarray:
        """Which windows have a forecast, made within 5 ms of them. [W] bool.

        Warns about forecasts that begin too far from the last detections, and about steps of unknown length.

        Raises:
            InputError: none has.
        """
        asked, sizes = request.asked, request.sizes
        rows = self._rows(asked.track_id, asked.time_s)
        answered: np.ndarray = rows >= 0
        if not answered.any():
            windows, forecasts = _span(asked.track_id, asked.time_s), _span(self.track_id, self.time_s)
            problem = f"no forecast belongs to a window: forecasts are of {forecasts}, windows of {windows}"
            raise InputError(self.source, None, problem, _SAME)
        if not answered.all():
            text = "%s has forecasts for %d of %d windows; all methods are compared there"
            _log.info(text, self.source, answered.sum(), len(answered))
        if self.step_s is None and (steps := self.path.shape[2]) > sizes.horizon_steps:
            text = "%s has %d steps and windows have %d: steps are taken to be %g s apart (--step-s)"
            _log.warning(text, self.source, steps, sizes.horizon_steps, sizes.dt_s)
        distance_m = np.linalg.norm(self.path[rows, 0, 0] - asked.last_position, axis=-1)[answered]
        if (usual_m := float(np.median(distance_m))) > FASTEST_MPS * (self.step_s or sizes.dt_s):
            text = "%s: forecasts usually begin %.3g m from the last detection: is the frame or unit another?"
            _log.warning(text, self.source, usual_m)
        return answered

    def __call__(self, request: ForecastRequest) -> Predictions:
        """The forecasts at the steps of the windows, interpolated from the last detection on.

        Raises:
            InputError: they end too early.
        """
        asked, ahead_s, dt_s = request.asked, request.ahead_s, request.sizes.dt_s
        steps = self.path.shape[2]
        knots_s = np.arange(steps + 1) * (self.step_s or dt_s)
        if knots_s[-1] < ahead_s[-1] - _SAME_S:
            problem = f"forecasts reach {knots_s[-1]:g} s ahead, and windows need {ahead_s[-1]:g} s"
            raise InputError(self.source, None, problem, "Steps of a table may be longer: --step-s")
        rows = self._rows(asked.track_id, asked.time_s)
        start = np.broadcast_to(asked.last_position[:, None, None], (len(rows), self.weight.shape[1], 1, 2))
        known = np.concatenate([start, self.path[rows]], axis=2)
        after = np.clip(np.searchsorted(knots_s, ahead_s - 1e-9), 1, steps)
        part = ((ahead_s - knots_s[after - 1]) / (knots_s[after] - knots_s[after - 1]))[:, None]
        path = (1.0 - part) * known[:, :, after - 1] + part * known[:, :, after]
        return Predictions(path[:, 0], path, self.weight[rows], dt_s)

    def _rows(self, track_id: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Row of the forecast that is nearest in time to each window, -1 where there is none. [W]."""
        own = pd.DataFrame({"track": self.track_id, "time": self.time_s, "row": np.arange(len(self.time_s))})
        asked = pd.DataFrame({"track": track_id, "time": np.asarray(time_s, float)}).sort_values("time")
        own = own.sort_values("time")
        found = pd.merge_asof(asked, own, on="time", by="track", direction="nearest", tolerance=_SAME_S)  # type: ignore[arg-type]
        rows = np.full(len(asked), -1)
        rows[asked.index] = found["row"].fillna(-1)
        return rows


def _span(track_id: np.ndarray, time_s: np.ndarray) -> str:
    tracks = np.unique(track_id)
    return f"{len(tracks)} tracks ({tracks[0]} ...) at {time_s.min():g} to {time_s.max():g} s"


def has_all_forecasts(foreign: Mapping[str, ForeignForecasts], request: ForecastRequest) -> np.ndarray:
    """Which windows have a forecast in every file. [W] bool.

    Raises:
        InputError: a file has none.
        ValueRuleError: there is no such window.
    """
    answered: np.ndarray = np.logical_and.reduce([one.has_forecast(request) for one in foreign.values()])
    if not answered.any():
        raise ValueRuleError("forecasts", list(foreign), "no window has a forecast in each of the files")
    return answered


def read_forecasts(
    path: Path, step_s: float | None = None, names: TrackNames | None = None
) -> ForeignForecasts:
    """Read a table of `pedpred.command.forecast_tables`, or .ndjson predictions of TrajNet++.

    Args:
        path: the file.
        step_s: time between two steps of a table, s; None: that of the windows. TrajNet++ says it itself.
        names: of tracks in the recording.

    Raises:
        InputError: the file cannot be understood, the message names the row or the forecast; or it has no
            forecast of a track of the recording.
    """
    check_input(path)
    with add_path(path):
        if path.suffix == ".ndjson":
            table, step_s = read_trajnet(path)
        else:
            table = read_forecast_table(path)
        if table.empty:
            raise ContentError("no forecasts")
        table = _in_recording(table, names or TrackNames())
        path_m, weight = _modes(table)
        made = table.drop_duplicates(["number", "time"])
        likely = np.argsort(-weight, axis=1, kind="stable")
        rows = np.arange(len(weight))[:, None]
        of_forecasts = made["number"].to_numpy(), made["time"].to_numpy()
        return ForeignForecasts(path, *of_forecasts, path_m[rows, likely], weight[rows, likely], step_s)


def _in_recording(table: pd.DataFrame, names: TrackNames) -> pd.DataFrame:
    """Add the numbers of tracks in the recording, drop forecasts of other tracks, and sort."""
    own_id, own = number_ids(pa.chunked_array([pa.array(table["track"])]), np.zeros(len(table), bool))
    present = np.unique(own_id)
    written = [str(name) for name in own.column(present)]
    number_of = {i: n for i, n in zip(present, names.numbers(written), strict=True) if n is not None}
    if not number_of:
        known = ", ".join([*names.of_number.values()][:3]) or "numbers"
        problem = f"forecasts are of {', '.join(written[:3])}; tracks of the recording are {known}"
        raise ContentError(problem, _SAME)
    table = table[np.isin(own_id, [*number_of])]
    number = [number_of[i] for i in own_id if i in number_of]
    return table.assign(number=number).sort_values(["number", "time", "mode", "step"])


def _modes(table: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Paths, [F, K, S, 2], and weights, [F, K], of a sorted table.

    Raises:
        ContentError: forecasts have different modes or steps, or weights are no shares.
    """
    made = ["number", "time"]
    steps, modes = table["step"].nunique(), table["mode"].nunique()
    is_whole = table.groupby(made)["step"].transform("size") == modes * steps
    is_whole &= ~table.duplicated([*made, "mode", "step"]) & table["step"].between(1, steps)
    _check(table, is_whole, f"it needs each step from 1 to {steps} once in each of {modes} modes")
    same = table.groupby([*made, "mode"])["weight"].transform("nunique") == 1
    some = table.groupby(made)["weight"].transform("sum") > 0
    rule = "weights must be the same at all steps of a mode, not negative, and not all 0"
    _check(table, same & some & (table["weight"] >= 0), rule)
    weight = table["weight"].to_numpy().reshape(-1, modes, steps)[..., 0]
    paths = table[["x", "y"]].to_numpy().reshape(-1, modes, steps, 2)
    return paths, weight / weight.sum(axis=1, keepdims=True)


def _check(table: pd.DataFrame, right: pd.Series, rule: str) -> None:
    if not right.all():
        wrong = table[~right].iloc[0]
        raise ContentError(f"the forecast of track {wrong['track']} at {wrong['time']:g} s: {rule}")
