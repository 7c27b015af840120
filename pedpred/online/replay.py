"""Replay a recorded scene through the online predictor, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from tqdm import tqdm

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.features import ForecastProtocol
from pedpred.features.targets import Futures
from pedpred.online.predictor import OnlinePredictor
from pedpred.scenes import Forecast, Predictions, Scene
from pedpred.tracking.tracks import TIME_TOLERANCE_S


def replay_scene(
    scene: Scene, predictor: OnlinePredictor, true_velocities: bool = False
) -> Iterator[Forecast]:
    """Yield a forecast after every frame of a scene's detections.

    Args:
        scene: a recorded place.
        predictor: it is reset first.
        true_velocities: use the velocities that a simulation knows instead of filtering positions.
    """
    predictor.reset()
    predictor.set_map(scene.occupancy)
    trajectories = scene.trajectories
    velocity = trajectories.velocity if true_velocities else None
    instants, first = np.unique(trajectories.time_s, return_index=True)
    for now, rows in zip(instants, np.split(np.arange(len(trajectories)), first[1:]), strict=True):
        true = None if velocity is None else velocity[rows]
        yield predictor.update(float(now), trajectories.track_id[rows], trajectories.position[rows], true)


def replay_with_progress(scene: Scene, predictor: OnlinePredictor) -> Iterator[Forecast]:
    """Yield the forecasts of `replay_scene`, with a progress bar."""
    forecasts, frames = replay_scene(scene, predictor), np.unique(scene.trajectories.time_s)
    yield from tqdm(forecasts, total=len(frames), desc=f"replay {scene.name}", unit="frame")


def predictions_at(
    forecasts: Iterable[Forecast], track_id: np.ndarray, time_s: np.ndarray, horizon_steps: int, dt_s: float
) -> Predictions:
    """Look up the forecasts of some people at some instants; NaN where there is none.

    Args:
        forecasts: in the order of time.
        track_id: whose. [W]
        time_s: when, s. [W]
        horizon_steps: P.
        dt_s: time between two steps, s.
    """
    order = np.argsort(time_s, kind="stable")
    sorted_s = time_s[order]
    nothing = np.full((len(order), horizon_steps, 2), np.nan)
    source, taken = np.full(len(order), -1), 0
    parts = []
    for forecast in forecasts:
        span = forecast.time_s - TIME_TOLERANCE_S, forecast.time_s + TIME_TOLERANCE_S
        rows = order[slice(*np.searchsorted(sorted_s, span))]
        rows = rows[np.isin(track_id[rows], forecast.track_id)]
        if len(rows):
            parts.append(forecast.predictions.select(np.searchsorted(forecast.track_id, track_id[rows])))
            source[rows] = taken + np.arange(len(rows))
            taken += len(rows)
    if not taken:
        return Predictions.single(nothing, dt_s)
    answer = Predictions.join(parts).select(source)
    for values in (answer.point, answer.path, answer.covariance):
        if values is not None:
            values[source < 0] = np.nan
    return answer


def as_windows(
    scene: Scene, forecasts: Iterable[Forecast], method: str, protocol: ForecastProtocol
) -> EvaluationWindows:
    """Arrange forecasts as rows beside the paths that people took.

    Args:
        scene: knows these paths; where one ends, its last position stands for the rest.
        forecasts: at any instants of it.
        method: what to call them.
        protocol: of the forecasts.

    Returns:
        One row per person and forecast; the grids are left empty.
    """
    frames = list(forecasts)
    dt_s, nobody = protocol.dt_s, np.zeros((0, protocol.horizon_steps, 2))
    predictions = Predictions.single(nobody, dt_s)
    if any(len(frame) for frame in frames):
        predictions = Predictions.join([frame.predictions for frame in frames if len(frame)])
    track_id = np.concatenate([np.zeros(0, np.int64), *(frame.track_id for frame in frames)])
    time_s = np.repeat([frame.time_s for frame in frames], [len(frame) for frame in frames])
    first = np.concatenate([nobody, *(frame.velocity for frame in frames)])[:, 0]
    truth, _ = Futures.of(scene.trajectories, protocol.lost_after_s).after(track_id, time_s, protocol.ahead_s)
    rows = len(track_id)
    return EvaluationWindows(
        track_id,
        time_s,
        position=predictions.point[:, 0] - first * dt_s,
        heading_rad=np.zeros(rows),
        velocity=first,
        packed_grid=np.zeros((rows, 0), np.uint8),
        angular_grid_m=np.zeros((rows, 0)),
        truth=truth,
        predictions={method: predictions},
        dt_s=dt_s,
    )
