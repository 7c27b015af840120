"""The protocol of most publications on the ETH and UCY recordings: 8 annotations seen, the next 12 forecast.

Windows are all stretches of 20 consecutive native annotations of one person, one per starting annotation.
Earlier annotations are not used. ADE is the mean distance over the 12 positions, FDE the distance
at the last. The networks do not take part: they forecast 3 s, 0.3 s by 0.3 s.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pedpred.errors import ShapeError, ValueRuleError
from pedpred.evaluation.scores import MetricSettings, Scores, describe_scene, score
from pedpred.features import FeatureTable, ForecastProtocol
from pedpred.features.surroundings import last_differences
from pedpred.fields import check_ranges
from pedpred.forecasting import Forecaster, ForecastRequest
from pedpred.metrics import METRICS
from pedpred.scenes import Scene, Trajectories
from pedpred.tracking import KalmanSettings, follow

_METRICS = {key: METRICS[key] for key in ("ade_m", "fde_m")}
_TOLERANCE_S = 1e-3


@dataclass(frozen=True, kw_only=True)
class LiteratureSettings:
    """The windows of the protocol.

    Attributes:
        observed_steps: annotations that are seen.
        predicted_steps: annotations that are forecast.
        step_s: time between two of them.
    """

    observed_steps: int
    predicted_steps: int
    step_s: float

    def __post_init__(self) -> None:
        check_ranges(self, {"observed_steps": "[2, 10000]", "predicted_steps": "[1, 10000]"})
        check_ranges(self, {"step_s": "(0, 60]"})


@dataclass(frozen=True)
class Stretches:
    """Consecutive annotations, world frame. W windows, O observed and P following positions.

    Attributes:
        track: of each window. [W]
        seen: observed positions, m. [W, O, 2]
        truth: the positions after them, m. [W, P, 2]
        step_s: between two annotations, s.
    """

    track: np.ndarray
    seen: np.ndarray
    truth: np.ndarray
    step_s: float

    def __post_init__(self) -> None:
        for own in fields(self):
            value = getattr(self, own.name)
            if own.name != "step_s" and len(value) != len(self.track):
                raise ShapeError(own.name, value.shape, f"[{len(self.track)}, ...]")
        if not self.step_s > 0:
            raise ValueRuleError("step_s", self.step_s, "it must be positive")


def find_stretches(trajectories: Trajectories, observed: int, predicted: int, step_s: float) -> Stretches:
    """Find all full windows: no annotation between the first and the last one is missing."""
    order = np.lexsort((trajectories.time_s, trajectories.track_id))
    track, time_s = trajectories.track_id[order], trajectories.time_s[order]
    follows = (np.diff(track) == 0) & (np.abs(np.diff(time_s) - step_s) < _TOLERANCE_S)
    length = observed + predicted
    if len(track) < length:
        first = np.zeros(0, dtype=np.int64)
    else:
        first = np.flatnonzero(sliding_window_view(follows, length - 1).all(axis=-1))
    paths = trajectories.position[order][first[:, None] + np.arange(length)]
    return Stretches(track[first], paths[:, :observed], paths[:, observed:], step_s)


def ask_about_stretches(scene: Scene, found: Stretches, tracker: KalmanSettings) -> ForecastRequest:
    """Ask for a forecast of each window by itself: every window is a track of its own.

    Args:
        scene: where the windows were seen; its other detections are left out.
        found: the windows.
        tracker: of the observed positions.
    """
    windows, observed = found.seen.shape[:2]
    track, rows = np.arange(windows), np.arange(1, windows + 1) * observed - 1
    time_s = np.tile(found.step_s * np.arange(observed), windows)
    seen = Trajectories(time_s, np.repeat(track, observed), found.seen.reshape(-1, 2))
    tracks = follow(seen, "kalman", tracker, standstill_mps=0.0)
    velocity, acceleration = last_differences(tracks, rows)
    steps = found.truth.shape[1]
    table = FeatureTable(
        track_id=track,
        phase=np.zeros(windows, np.int8),
        step=np.full(windows, observed - 1, np.int32),
        time_s=time_s[rows],
        position=tracks.position[rows],
        heading_rad=np.zeros(windows),  # the agent frame is the world frame
        velocity=tracks.velocity[rows],
        last_position=found.seen[:, -1],
        last_velocity=velocity,
        last_acceleration=acceleration,
        future=np.zeros((windows, steps, 2), np.float32),
        future_steps=np.full(windows, steps, np.int8),
    )
    sizes = ForecastProtocol(dt_s=found.step_s, horizon_steps=steps)
    return ForecastRequest(
        replace(scene, trajectories=seen), table, sizes, track, tracker, detection_interval_s=found.step_s
    )


def score_stretches(
    request: ForecastRequest, found: Stretches, forecaster: Forecaster, settings: MetricSettings
) -> Scores:
    """Measure a forecaster in all windows of a place.

    Args:
        request: about the windows; see `ask_about_stretches`.
        found: the windows.
        forecaster: any of present motion.
        settings: thresholds of the metrics.

    Raises:
        ValueRuleError: there are no windows.
    """
    if not len(found.track):
        raise ValueRuleError("windows", 0, "there must be full windows to measure")
    scene = describe_scene(request.table, request.scene.occupancy, settings)
    return score(forecaster(request), found.truth, found.track, scene, _METRICS)
