"""Windows of most publications on ETH and UCY: 8 annotations are observed, the next 12 are forecast.

Windows are all stretches of 20 consecutive annotations of one person, one per starting annotation. Nothing
earlier is known of anybody: each instant at which windows end becomes a short recording of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pedpred.errors import ValueRuleError
from pedpred.evaluation.windows import WindowSet, request_about
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception
from pedpred.scenes import Scene, Trajectories
from pedpred.settings import In, Settings
from pedpred.tracking.tracks import last_rows

TOLERANCE_S = 1e-3
"""Two annotations follow each other if their distance in time differs from the step by less than this, s."""
_APART_S = 1000.0
"""Time between the ends of two short recordings, longer than any window, s."""


@dataclass(frozen=True, kw_only=True)
class WindowSettings(Settings):
    """The windows of the protocol.

    Attributes:
        observed_steps: annotations that are observed.
        predicted_steps: annotations that are forecast.
        step_s: time between two of them.
    """

    observed_steps: Annotated[int, In("[2, 10000]")]
    predicted_steps: Annotated[int, In("[1, 10000]")]
    step_s: Annotated[float, In("(0, 60]")]

    @property
    def protocol(self) -> ForecastProtocol:
        """Time step and horizon."""
        return ForecastProtocol(dt_s=self.step_s, horizon_steps=self.predicted_steps)


def find_observed_windows(
    scene: Scene, how: Perception, settings: WindowSettings, memory: bool = True
) -> WindowSet:
    """Find all full windows of a recording, in the company of everybody who is present when they end.

    Args:
        scene: annotations every `step_s`; they are the truth.
        how: how its people are perceived.
        settings: of the windows.
        memory: compute the steps of networks with a memory, which takes half of the time.

    Raises:
        ValueRuleError: there is no window.
    """
    people, observed = scene.trajectories, settings.observed_steps
    length = observed + settings.predicted_steps
    rows = consecutive_rows(people, length, settings.step_s)
    if not len(rows):
        raise ValueRuleError("windows", 0, f"nobody in {scene.name} is annotated {length} times in a row")
    track, end_s = people.track_id[rows[:, 0]], people.time_s[rows[:, observed - 1]]
    ends_s = np.unique(end_s)
    ends_s = ends_s[np.diff(ends_s, prepend=-np.inf) > TOLERANCE_S]
    recording = np.searchsorted(ends_s, end_s, side="right") - 1
    seen = replace(
        scene, trajectories=short_recordings(people, ends_s, settings), detection_dt_s=settings.step_s
    )
    ids = np.unique(people.track_id)
    # Ids and times in the short recordings, see `short_recordings`.
    asked, now_s = recording * len(ids) + np.searchsorted(ids, track), recording * _APART_S
    path = people.position[rows[:, observed - 1 :]]
    when_s = now_s[:, None] + settings.step_s * np.arange(path.shape[1])
    truth = Trajectories(when_s.ravel(), np.repeat(asked, path.shape[1]), path.reshape(-1, 2))
    request = request_about(seen, how, settings.protocol, truth, memory)
    request = replace(request, rows=last_rows(request.past.track_id, request.past.time_s, asked, now_s))
    return WindowSet(request, path[:, 1:], track, end_s)


def consecutive_rows(people: Trajectories, length: int, step_s: float) -> np.ndarray:
    """Rows of all stretches of annotations of one person that follow each other at the step. [W, length]."""
    order = np.lexsort((people.time_s, people.track_id))
    track, time_s = people.track_id[order], people.time_s[order]
    if len(track) < length:
        return np.zeros((0, length), np.int64)
    follows = (np.diff(track) == 0) & (np.abs(np.diff(time_s) - step_s) < TOLERANCE_S)
    first = np.flatnonzero(sliding_window_view(follows, length - 1).all(axis=-1))
    return order[first[:, None] + np.arange(length)]


def short_recordings(people: Trajectories, ends_s: np.ndarray, settings: WindowSettings) -> Trajectories:
    """The last annotations up to some instants, as recordings one after the other.

    Recording i ends at `i * _APART_S`. Of T people in all, the k-th in the order of ids is `i * T + k` in it.
    It holds those who are annotated at its end.

    Args:
        people: of the recording.
        ends_s: the instants, rising, s. [I]
        settings: number of annotations, and the time between them.
    """
    ids, person = np.unique(people.track_id, return_inverse=True)
    parts = []
    for ago in range(settings.observed_steps):
        then_s, near_s = people.time_s + ago * settings.step_s, (ago + 1) * TOLERANCE_S
        recording = np.minimum(np.searchsorted(ends_s, then_s - near_s), len(ends_s) - 1)
        row = np.flatnonzero(np.abs(ends_s[recording] - then_s) < near_s)
        time_s = recording[row] * _APART_S - ago * settings.step_s
        parts.append((time_s, recording[row] * len(ids) + person[row], people.position[row]))
    time_s, track, position = (np.concatenate(column) for column in zip(*parts, strict=True))
    present = np.isin(track, parts[0][1])
    return Trajectories(time_s[present], track[present], position[present])
