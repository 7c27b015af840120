"""Forecasts of other programs, from tables or TrajNet++, as a forecaster for the windows that they cover."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from pedpred.command.forecast_tables import read_forecast_table
from pedpred.command.trajnet import read_trajnet_forecasts
from pedpred.errors import InputError, ValueRuleError
from pedpred.forecasting import ForecastRequest
from pedpred.reading.checks import FASTEST_MPS
from pedpred.reading.errors import ContentError, add_path
from pedpred.reading.names import TrackNames, number_ids
from pedpred.ros import Transform
from pedpred.scenes import Predictions

_SAME_S = 0.005
_SAME = "Ids and times must be those of the recording"
_SHOWN = 3
_TRAJNET = ".ndjson"
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ForeignForecasts:
    """Forecasts of some people at some instants, world frame; a forecaster for the windows that they cover.

    Attributes:
        source: the file.
        track_id: of the person. [F]
        time_s: when each was made, s. [F]
        path: modes, the most likely first, m. [F, K, S, 2]
        weight: of the modes. [F, K]
        step_s: time between two steps, s; None: that of the windows.
        names: of tracks, where `track_id` counts words.
    """

    source: Path
    track_id: np.ndarray
    time_s: np.ndarray
    path: np.ndarray
    weight: np.ndarray
    step_s: float | None
    names: TrackNames = field(default_factory=TrackNames)

    def of_tracks(self, names: TrackNames) -> ForeignForecasts:
        """The forecasts of the people in a recording, under the numbers that these have there.

        Args:
            names: of tracks in the recording.

        Raises:
            InputError: none of them is there.
        """
        if not self.names.of_number and not names.of_number:
            return self
        present, inverse = np.unique(self.track_id, return_inverse=True)
        written = [str(name) for name in self.names.column(present)]
        numbers = names.numbers(written)
        here = np.array([number is not None for number in numbers], bool)
        if not here.any():
            shown, known = (", ".join(some[:_SHOWN]) for some in (written, list(names.of_number.values())))
            problem = f"forecasts are of {shown}; tracks of the recording are {known or 'numbers'}"
            raise InputError(self.source, None, problem, _SAME)
        number = np.array([number or 0 for number in numbers], np.int64)
        rows = here[inverse]
        kept = {name: getattr(self, name)[rows] for name in ("time_s", "path", "weight")}
        return replace(self, track_id=number[inverse][rows], names=names, **kept)

    def moved(self, transform: Transform) -> ForeignForecasts:
        """Transform forecasts from the frame of the people to that of the map."""
        return replace(self, path=transform.to_map(self.path))

    def answered(self, request: ForecastRequest) -> np.ndarray:
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
            problem = f"no forecast belongs to a window of {request.scene.name}: forecasts are of {forecasts}"
            raise InputError(self.source, None, f"{problem}, windows of {windows}", _SAME)
        if not answered.all():
            text = "%s has forecasts for %d of %d windows; all methods are compared there"
            _log.info(text, self.source, answered.sum(), len(answered))
        if self.step_s is None and (steps := self.path.shape[2]) > sizes.horizon_steps:
            text = "%s has %d steps and windows have %d: steps are taken to be %g s apart (--step-s)"
            _log.warning(text, self.source, steps, sizes.horizon_steps, sizes.dt_s)
        distance_m = np.linalg.norm(self.path[rows, 0, 0] - asked.last_position, axis=-1)[answered]
        usual_m = float(np.median(distance_m))
        if usual_m > FASTEST_MPS * (self.step_s or sizes.dt_s):
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
    some = ", ".join(map(str, tracks[:_SHOWN].tolist()))
    return f"{len(tracks)} tracks ({some} ...) at {time_s.min():g} to {time_s.max():g} s"


def answered_by_all(foreign: Mapping[str, ForeignForecasts], request: ForecastRequest) -> np.ndarray:
    """Which windows have a forecast in every file. [W] bool.

    Raises:
        InputError: a file has none.
        ValueRuleError: there is no such window.
    """
    answered: np.ndarray = np.logical_and.reduce(
        [forecasts.answered(request) for forecasts in foreign.values()]
    )
    if not answered.any():
        raise ValueRuleError("--forecasts", list(foreign), "no window has a forecast in each of the files")
    return answered


def unique_names(named: Sequence[tuple[str, Path]], taken: Collection[str] = ()) -> list[str]:
    """Give a name to the content of each file: one that appears twice is followed by the file's path.

    Args:
        named: the name of the content of each file, and the file.
        taken: names of other things.

    Raises:
        ValueRuleError: two still have one name.
    """
    count = Counter([*taken, *(name for name, _ in named)])
    names = [name if count[name] == 1 else f"{name} ({path})" for name, path in named]
    if repeated := [name for name, times in Counter(names).items() if times > 1 or name in taken]:
        raise ValueRuleError("name", repeated[0], "two inputs have it: rename a file, or give it once")
    return names


def read_forecasts(path: Path, step_s: float | None) -> ForeignForecasts:
    """Read a table of `pedpred.command.forecast_tables`, or .ndjson predictions of TrajNet++.

    Args:
        path: the file.
        step_s: time between two steps of a table, s; None: that of the windows. TrajNet++ says it itself.

    Raises:
        InputError: the file cannot be understood; the message names the row or the forecast.
    """
    if path.suffix == _TRAJNET:
        table, step_s = read_trajnet_forecasts(path)
    else:
        table = read_forecast_table(path)
    with add_path(path):
        if table.empty:
            raise ContentError("no forecasts")
        ids = pa.chunked_array([pa.array(table["track"])])
        track_id, names = number_ids(ids, np.zeros(len(table), bool))
        table = table.assign(track=track_id).sort_values(["track", "time", "mode", "step"])
        return _from_sorted(path, table, step_s, names)


def _from_sorted(
    path: Path, table: pd.DataFrame, step_s: float | None, names: TrackNames
) -> ForeignForecasts:
    """Put sorted rows together, the most likely modes first."""
    modes, steps = np.unique(table["mode"]), np.arange(1, table["step"].nunique() + 1)
    each = len(modes) * len(steps)
    is_whole = (table.groupby(["track", "time"])["step"].transform("size") == each).to_numpy()
    if is_whole.all():
        mode, step = (table[name].to_numpy().reshape(-1, len(modes), len(steps)) for name in ("mode", "step"))
        is_whole = np.repeat(((mode == modes[:, None]) & (step == steps)).all(axis=(1, 2)), each)
    rule = f"it needs each step from 1 to {len(steps)} once in each of {len(modes)} modes, as the others"
    _check_forecasts(table, is_whole, names, rule)
    first = table.iloc[::each]
    weight = table["weight"].to_numpy().reshape(-1, len(modes), len(steps))
    largest = weight[..., 0].max(axis=1)
    is_right = (weight >= 0).all(axis=(1, 2)) & (weight == weight[..., :1]).all(axis=(1, 2)) & (largest > 0)
    rule = "weights must be the same at all steps of a mode, not negative, and not all 0"
    _check_forecasts(first, is_right, names, rule)
    share = weight[..., 0] / largest[:, None]  # first, because sums of large weights overflow
    share /= share.sum(axis=1, keepdims=True)
    likely = np.argsort(-share, axis=1, kind="stable")
    rows = np.arange(len(share))[:, None]
    paths = table[["x", "y"]].to_numpy().reshape(-1, len(modes), len(steps), 2)
    track_id, time_s = first["track"].to_numpy(), first["time"].to_numpy()
    return ForeignForecasts(path, track_id, time_s, paths[rows, likely], share[rows, likely], step_s, names)


def _check_forecasts(table: pd.DataFrame, right: np.ndarray, names: TrackNames, rule: str) -> None:
    """Raise a `ContentError` that names the first row that is not right."""
    if not right.all():
        row = int(np.argmin(right))
        number, time_s = int(table["track"].iloc[row]), float(table["time"].iloc[row])
        track = names.of_number.get(number, number)
        raise ContentError(f"the forecast of track {track} at {time_s:g} s: {rule}")
