"""Windows of the literature in company: a person and everybody around, in the same 8 annotations.

Each instant at which a window ends is a small recording of its own, which holds the last annotations up to it
and nothing earlier; so no forecast knows more than the protocol allows, of anybody.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.features import ForecastProtocol, ModelFeatures, extract, extract_at_detections
from pedpred.forecasting import ForecastRequest
from pedpred.literature.settings import WindowSettings
from pedpred.literature.stretches import TOLERANCE_S, Stretches, find_stretches
from pedpred.scenes import Scene, Trajectories
from pedpred.tracking import KalmanBank, follow
from pedpred.tracking.tracks import last_rows

_APART_S = 1000.0
"""Time between two instants that have nothing to do with each other, longer than any window."""


@dataclass(frozen=True)
class WindowSet:
    """All windows of a recording, and what is asked about them.

    Attributes:
        request: about the windows; its tracks hold everybody who is present when one of them ends. [W]
        truth: true positions after the windows, m. [W, P, 2]
        track: of each window, an id of the recording. [W]
        end_s: last annotation that is seen, in the time of the recording, s. [W]
    """

    request: ForecastRequest
    truth: np.ndarray
    track: np.ndarray
    end_s: np.ndarray


def protocol_of(settings: WindowSettings) -> ForecastProtocol:
    """The time step and horizon of the literature."""
    return ForecastProtocol(dt_s=settings.step_s, horizon_steps=settings.predicted_steps)


def find_windows(
    scene: Scene, settings: WindowSettings, tracker: KalmanBank, standstill_mps: float, memory: bool = True
) -> WindowSet:
    """Find all full windows of a recording, as `find_stretches` does, and ask about them.

    Args:
        scene: annotations every `step_s`.
        settings: of the windows.
        tracker: of the observed positions.
        standstill_mps: below this speed the heading is held, m/s.
        memory: compute the steps of networks with a memory, which takes half of the time.

    Raises:
        ValueRuleError: there are no windows.
    """
    whole, step_s = scene.trajectories, settings.step_s
    stretches = find_stretches(whole, settings.observed_steps, settings.predicted_steps, step_s)
    if not len(stretches.track):
        length = settings.observed_steps + settings.predicted_steps
        raise ValueRuleError("windows", 0, f"nobody in {scene.name} is annotated {length} times in a row")
    ends_s = np.unique(stretches.end_s)
    ends_s = ends_s[np.diff(ends_s, prepend=-np.inf) > TOLERANCE_S]
    instant = np.searchsorted(ends_s, stretches.end_s, side="right") - 1
    people, person = np.unique(whole.track_id, return_inverse=True)
    parts = []
    for ago in range(settings.observed_steps):
        then_s, near_s = whole.time_s + ago * step_s, (ago + 1) * TOLERANCE_S
        at = np.minimum(np.searchsorted(ends_s, then_s - near_s), len(ends_s) - 1)
        row = np.flatnonzero(np.abs(ends_s[at] - then_s) < near_s)
        now_s = at[row] * _APART_S - ago * step_s
        parts.append((now_s, at[row] * len(people) + person[row], whole.position[row]))
    now_s, track, position = (np.concatenate(column) for column in zip(*parts, strict=True))
    stays = np.isin(track, parts[0][1])
    seen = replace(scene, trajectories=Trajectories(now_s[stays], track[stays], position[stays]))
    asked = instant * len(people) + np.searchsorted(people, stretches.track)
    protocol = protocol_of(settings)
    return WindowSet(
        _ask(seen, stretches, asked, instant * _APART_S, tracker, standstill_mps, protocol, memory),
        stretches.truth,
        stretches.track,
        stretches.end_s,
    )


def _ask(
    seen: Scene,
    stretches: Stretches,
    asked: np.ndarray,
    now_s: np.ndarray,
    tracker: KalmanBank,
    standstill_mps: float,
    protocol: ForecastProtocol,
    memory: bool,
) -> ForecastRequest:
    """Track the people of all instants and ask about those of the windows. [W] tracks at their instants."""
    tracks = follow(seen.trajectories, "kalman", tracker, standstill_mps)
    steps = stretches.truth.shape[1] + 1
    path = np.concatenate([stretches.seen[:, -1:], stretches.truth], axis=1)
    when_s = now_s[:, None] + stretches.step_s * np.arange(steps)
    truth = Trajectories(when_s.ravel(), np.repeat(asked, steps), path.reshape(-1, 2))
    table = extract_at_detections(seen, tracks, protocol, truth)
    clock = extract(seen, tracks, protocol) if memory else None
    rows = last_rows(tracks.track_id, tracks.time_s, asked, now_s)
    noise = tracker.filters[0]
    return ForecastRequest(seen, table, protocol, rows, noise, stretches.step_s, clock=clock, tracks=tracks)


def training_rows(windows: WindowSet, features: ModelFeatures, parts: int) -> Iterator[dict[str, np.ndarray]]:
    """Inputs and targets in all windows of a recording, in stretches of equal time.

    Args:
        windows: of the recording.
        features: of the model.
        parts: number of stretches.

    Yields:
        The inputs, and `future`, m/s, agent frame, [M, P, 2] float32.
    """
    request = windows.request
    order = np.argsort(windows.end_s, kind="stable")
    edges = np.linspace(windows.end_s.min(), windows.end_s.max(), parts + 1)[1:-1]
    for which in np.split(order, np.searchsorted(windows.end_s[order], edges)):
        row = request.rows[which]
        inputs = request.inputs(features, row, request.table.time_s[row])
        yield inputs | {"future": request.table.future[row]}
