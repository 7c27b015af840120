"""Forecasts of other programs, from tables or TrajNet++, as a forecaster for the windows that they cover."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import cycle
from pathlib import Path

import numpy as np

from pedpred.command.forecast_tables import read_forecast_table
from pedpred.command.trajnet import trajnet_columns
from pedpred.errors import InputError, ValueRuleError
from pedpred.forecasting import ForecastRequest
from pedpred.reading.checks import FASTEST_MPS
from pedpred.reading.names import TrackNames
from pedpred.ros import Transform
from pedpred.scenes import Predictions

_SAME_S = 0.005
_SAME = "Ids and times must be those of the recording"
_SHOWN = 3
_TRAJNET = ".ndjson"
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class ForeignForecasts:
    """Forecasts of some people at some instants, world frame; a forecaster for the windows that they cover.

    Attributes:
        source: the file.
        track_id: whose, rising. [F]
        time_s: when each was made, rising within a track, s. [F]
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
        present, whose = np.unique(self.track_id, return_inverse=True)
        written = [str(name) for name in self.names.column(present)]
        numbers = names.numbers(written)
        here = np.array([number is not None for number in numbers], bool)
        if not here.any():
            shown, known = (", ".join(some[:_SHOWN]) for some in (written, list(names.of_number.values())))
            problem = f"forecasts are of {shown}; tracks of the recording are {known or 'numbers'}"
            raise InputError(self.source, None, problem, _SAME)
        number = np.array([0 if number is None else number for number in numbers], np.int64)[whose]
        order = np.lexsort((self.time_s, number))
        order = order[here[whose][order]]
        kept = {name: getattr(self, name)[order] for name in ("time_s", "path", "weight")}
        return replace(self, track_id=number[order], names=names, **kept)

    def moved(self, transform: Transform) -> ForeignForecasts:
        """Transform forecasts from the frame of the people to that of the map."""
        return replace(self, path=transform.to_map(self.path))

    def answered(self, request: ForecastRequest) -> np.ndarray:
        """Which windows have a forecast, made within 5 ms of them. [W] bool.

        Forecasts that begin where nobody can be by then are warned about.

        Raises:
            InputError: none has.
        """
        asked = request.asked
        rows = self._rows(asked.track_id, asked.time_s)
        answered = rows >= 0
        if not answered.any():
            windows, forecasts = _span(asked.track_id, asked.time_s), _span(self.track_id, self.time_s)
            problem = (
                f"no forecast belongs to a window of {request.scene.name}: forecasts are of {forecasts}, "
            )
            raise InputError(self.source, None, f"{problem}windows of {windows}", _SAME)
        if not answered.all():
            text = "%s has forecasts for %d of %d windows; all methods are compared there"
            _LOG.info(text, self.source, answered.sum(), len(answered))
        self._say_step(request)
        way_m = np.linalg.norm(self.path[rows, 0, 0] - asked.last_position, axis=-1)[answered]
        speed_mps = float(np.median(way_m)) / (self.step_s or request.sizes.dt_s)
        if speed_mps > FASTEST_MPS:
            text = "%s: forecasts usually begin %.3g m from where people were detected last: %s"
            _LOG.warning(
                text, self.source, np.median(way_m), "are x and y those of the recording, in metres?"
            )
        return answered

    def __call__(self, request: ForecastRequest) -> Predictions:
        """The forecasts at the steps of the windows, interpolated from the last detection on."""
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

    def _say_step(self, request: ForecastRequest) -> None:
        """Warn that nobody said how far apart steps are whose number differs from that of the windows."""
        steps, usual, dt_s = self.path.shape[2], request.sizes.horizon_steps, request.sizes.dt_s
        if self.step_s is None and steps > usual:
            text = "%s has %d steps and windows have %d: its steps are taken to be %g s apart, like those of "
            text += "windows; --step-s says how far apart they are"
            _LOG.warning(text, self.source, steps, usual, dt_s)

    def _rows(self, track_id: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Row of the forecast of each window, -1 where there is none. [W]."""
        whose, when_s = np.append(self.track_id, track_id), np.append(self.time_s, time_s)
        asked = np.arange(len(whose)) >= len(self.track_id)
        order = np.lexsort((asked, when_s, whose))
        made = np.empty(len(whose), np.int64)  # forecasts up to each window, in the order of people and times
        made[order] = np.cumsum(~asked[order])
        near = np.clip(made[asked] - [[1], [0]], 0, len(self.track_id) - 1)
        gaps_s = np.where(self.track_id[near] == track_id, np.abs(self.time_s[near] - time_s), np.inf)
        best = np.take_along_axis(near, gaps_s.argmin(axis=0)[None], axis=0)[0]
        rows: np.ndarray = np.where(gaps_s.min(axis=0) <= _SAME_S, best, -1)
        return rows


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


def steps_of_tables(files: Sequence[Path], steps_s: Sequence[float]) -> dict[Path, float]:
    """Say what is the time between two steps of each table of forecasts; of others, files tell it.

    Args:
        files: of forecasts.
        steps_s: none, one for all tables, or one for each of them in this order, s.

    Raises:
        ValueRuleError: it is another number of times, or there is no table.
    """
    tables = [path for path in files if path.suffix != _TRAJNET]
    if steps_s and not tables:
        raise ValueRuleError("--step-s", steps_s[0], "it is about a table: --forecasts FILE.csv")
    if len(steps_s) > 1 and len(steps_s) != len(tables):
        rule = f"give it once for all tables, or once for each of {len(tables)} in their order"
        raise ValueRuleError("--step-s", list(steps_s), rule)
    return dict(zip(tables, cycle(steps_s), strict=False))


def names_of_files(named: Sequence[tuple[str, Path]], taken: Collection[str] = ()) -> list[str]:
    """Tell what files hold apart: a name that is taken or appears twice is followed by the file's path.

    Args:
        named: the name of what is in each file, and the file.
        taken: names of other things.

    Raises:
        ValueRuleError: two still have one name.
    """
    count = Counter([*taken, *(name for name, _ in named)])
    names: list[str] = []
    for name, path in named:
        whole = name if count[name] == 1 else f"{name} ({path})"
        if whole != name:
            _LOG.info("what is in %s is called '%s', since its name is taken", path, whole)
        if whole in (*taken, *names):
            raise ValueRuleError("name", whole, f"that of {path} is taken: rename the file or folder")
        names.append(whole)
    return names


def _span(track_id: np.ndarray, time_s: np.ndarray) -> str:
    some = ", ".join(map(str, np.unique(track_id)[:3].tolist()))
    return f"{len(np.unique(track_id))} tracks ({some} ...) at {time_s.min():g} to {time_s.max():g} s"


def read_forecasts(path: Path, step_s: float | None) -> ForeignForecasts:
    """Read a table of `pedpred.command.forecast_tables`, or .ndjson predictions of TrajNet++.

    Args:
        path: the file.
        step_s: time between two steps of a table, s; None: that of the windows.

    Raises:
        InputError: the file cannot be understood; it names the line, or whose forecast is wrong.
    """
    names = TrackNames()
    if path.suffix == _TRAJNET:
        columns, step_s = trajnet_columns(path)
    else:
        columns, names = read_forecast_table(path)
    if not len(columns["line"]):
        raise InputError(path, None, "no forecasts")
    keys = ("track_id", "time", "mode", "step")
    order = np.lexsort([columns[name] for name in reversed(keys)])
    track, time_s, mode, step = (columns[name][order] for name in keys)
    whole = np.flatnonzero(np.append(True, (track[1:] != track[:-1]) | (time_s[1:] != time_s[:-1])))
    modes, steps = len(np.unique(mode)), len(np.unique(step))
    fits = np.diff(np.append(whole, len(order))) == modes * steps
    if fits.all():
        same_mode = mode.reshape(-1, modes, steps) == np.unique(mode)[:, None]
        same_step = step.reshape(-1, modes, steps) == np.arange(1, steps + 1)
        fits = (same_mode & same_step).all(axis=(1, 2))
    if not fits.all():
        row = order[whole[np.flatnonzero(~fits)[0]]]
        who = names.column(columns["track_id"][row : row + 1])[0]
        problem = f"the forecast of track {who} at {columns['time'][row]:g} s"
        needed = f"needs each step from 1 to {steps} once in each of {modes} modes, as the others have it"
        raise InputError(path, int(columns["line"][row]), f"{problem} {needed}")
    return _forecasts(path, columns, order, (len(whole), modes, steps), step_s, names)


def _forecasts(
    path: Path,
    columns: dict[str, np.ndarray],
    order: np.ndarray,
    shape: tuple[int, int, int],
    step_s: float | None,
    names: TrackNames,
) -> ForeignForecasts:
    """Put sorted rows together, the most likely modes first."""
    paths = np.stack([columns["x"], columns["y"]], axis=-1)[order].reshape(*shape, 2)
    weights = columns["weight"][order].reshape(shape)
    largest = weights[..., 0].max(axis=1)
    wrong = (weights < 0).any(axis=(1, 2)) | (weights != weights[..., :1]).any(axis=(1, 2)) | ~(largest > 0)
    if wrong.any():
        row = order[np.flatnonzero(wrong)[0] * shape[1] * shape[2]]
        rule = "weights are the same at all steps of a mode, not negative, and not all 0"
        raise InputError(path, int(columns["line"][row]), f"weight = {columns['weight'][row]:g}, but {rule}")
    weight = weights[..., 0] / largest[:, None]  # first, because sums of large weights overflow
    weight /= weight.sum(axis=1, keepdims=True)
    likely = np.argsort(-weight, axis=1, kind="stable")
    rows = np.arange(shape[0])[:, None]
    first = order[:: shape[1] * shape[2]]
    return ForeignForecasts(
        path,
        columns["track_id"][first],
        columns["time"][first],
        paths[rows, likely],
        weight[rows, likely],
        step_s,
        names,
    )
