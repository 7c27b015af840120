"""The evaluation windows of a scene: every detection with a past to go by and a known future."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.features import FeatureTable, ForecastProtocol, clock_steps, extract_at_detections
from pedpred.features.perception import Perception, perceived
from pedpred.forecasting import ForecastRequest
from pedpred.geometry import rotate
from pedpred.scenes import Scene, Trajectories
from pedpred.simulation.settings import SocialForceSettings
from pedpred.tracking import KalmanBank
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_LOG = logging.getLogger(__name__)
_REPORTED_SHARE = 0.01  # of lost windows


@dataclass(frozen=True)
class WindowSet:
    """Evaluation windows of a scene: what forecasters are asked, and what then happened. W windows, P steps.

    Attributes:
        request: about the windows. [W]
        truth: true positions at the steps of the horizon, world frame, m. [W, P, 2]
        track: of each window, an id of the recording. [W]
        time_s: the present of each window, in the time of the recording, s. [W]
        without_truth: number of detections that are no windows because their truth has gaps.
    """

    request: ForecastRequest
    truth: np.ndarray
    track: np.ndarray
    time_s: np.ndarray
    without_truth: int = 0

    def __len__(self) -> int:
        return len(self.track)

    def select(self, rows: np.ndarray) -> WindowSet:
        """Some of the windows (mask or indices)."""
        request = replace(self.request, rows=self.request.rows[rows])
        known = {name: getattr(self, name)[rows] for name in ("truth", "track", "time_s")}
        return replace(self, request=request, **known)


def find_windows(
    scene: Scene,
    how: Perception,
    protocol: ForecastProtocol,
    social_force: SocialForceSettings | None = None,
    memory: bool = True,
) -> WindowSet:
    """Perceive the people of a scene and find its evaluation windows, see `window_rows`.

    Args:
        scene: a place; detections at any rate, regular or not. Their spline is the truth.
        how: how its people are perceived.
        protocol: time step, horizon, ages; the clock of networks with a memory begins at the first
            detection (one phase), even if training uses several.
        social_force: the model of walking there; None where there is none.
        memory: compute the steps of networks with a memory.

    Raises:
        ValueRuleError: there is no window.
    """
    request = request_about(scene, how, protocol, scene.trajectories, memory)
    rows, without_truth = window_rows(request.table, protocol, scene.name)
    request = replace(request, scene=scene, rows=rows, social_force=social_force)
    asked = request.asked
    truth = integrate_truth(asked, protocol.dt_s)
    return WindowSet(request, truth, asked.track_id, asked.time_s, without_truth)


def request_about(
    scene: Scene, how: Perception, protocol: ForecastProtocol, truth: Trajectories, memory: bool
) -> ForecastRequest:
    """Perceive the people of a scene and ask about all their detections.

    Args:
        scene: a place and its people.
        how: how they are perceived.
        protocol: time step, horizon, ages.
        truth: their true paths.
        memory: compute the steps of networks with a memory.
    """
    seen, tracks = perceived(scene, how, protocol)
    tracker = how.kalman.filters[0] if isinstance(how.kalman, KalmanBank) else how.kalman
    table = extract_at_detections(seen, tracks, protocol, truth)
    return ForecastRequest(
        scene=seen,
        table=table,
        sizes=protocol,
        rows=np.arange(len(table)),
        tracker=None if protocol.noncausal else tracker,
        detection_interval_s=seen.detection_dt_s,
        clock=clock_steps(tracks, seen.detection_dt_s, protocol.dt_s) if memory else None,
        tracks=tracks,
        detection_noise_m=how.sensor.position_noise_m,
    )


def window_rows(table: FeatureTable, protocol: ForecastProtocol, place: str) -> tuple[np.ndarray, int]:
    """Find the evaluation windows in a table at detections.

    A window is a detection with at least `min_history` earlier ones of the same life and a true position at
    every step of the horizon. Detections that lack nothing but this truth are counted: the person is still
    there at the end of the horizon, but was lost for a while in between. Many of them are reported in the
    log.

    Args:
        table: at detections.
        protocol: of the table.
        place: named in messages.

    Returns:
        Rows of the windows [W], and the number of detections without truth.

    Raises:
        ValueRuleError: there is no window.
    """
    past = table.step >= protocol.min_history
    known = table.future_steps == protocol.horizon_steps
    windows = np.flatnonzero(past & known)
    last = np.append(table.step[1:] == 0, True)[: len(table)]  # of each life
    end_s = table.time_s[last][np.cumsum(last) - last]
    ahead_s = protocol.horizon_steps * protocol.dt_s
    stays = table.time_s + ahead_s <= end_s + TIME_TOLERANCE_S
    lost = int((past & stays & ~known).sum())
    gap = f"between detections more than {protocol.truth_gap_s:g} s apart (truth_gap_s) there is no truth"
    if not len(windows):
        nobody = f"nobody in {place} is detected {protocol.min_history + 1} times and {ahead_s:g} s longer"
        nobody += f" without being lost for more than {protocol.lost_after_s:g} s"
        cause = f"none of {lost} is left in {place}: {gap}" if lost else nobody
        raise ValueRuleError("windows", 0, cause + _usual_interval(table))
    eligible = len(windows) + lost
    if lost > _REPORTED_SHARE * eligible:
        _LOG.warning("%s: %d of %d windows are lost: %s", place, lost, eligible, gap)
    return windows, lost


def _usual_interval(table: FeatureTable) -> str:
    """Say how often people are detected, which tells whether the times are what they should be."""
    same = np.diff(table.track_id) == 0
    if not same.any():
        return ""
    usual_s = float(np.median(np.diff(table.time_s)[same]))
    return f"; detections of a person are usually {usual_s:g} s apart (time stamps must be in seconds)"


def integrate_truth(asked: FeatureTable, dt_s: float) -> np.ndarray:
    """Integrate the targets of evaluation windows to true paths, world frame, m. [W, P, 2]."""
    walked = np.cumsum(asked.future.astype(np.float64) * dt_s, axis=1)
    return asked.position[:, None] + rotate(walked, asked.heading_rad[:, None])
