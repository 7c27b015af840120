"""Replay a recorded scene through the online predictor, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from pedpred.features import FeatureSettings
from pedpred.features.targets import Futures
from pedpred.online.predictor import OnlinePredictor
from pedpred.scenes import Forecast, Predictions, Scene
from pedpred.storage.windows import EvaluationWindows
from pedpred.tracking.tracks import TIME_TOLERANCE_S


def replayed(scene: Scene, predictor: OnlinePredictor, true_velocities: bool = False) -> Iterator[Forecast]:
    """Yield a forecast after every frame of a scene's detections.

    Args:
        scene: a recorded place.
        predictor: it is reset first.
        true_velocities: use the velocities that a simulation knows instead of filtering positions.
    """
    predictor.reset()
    predictor.set_map(scene.occupancy)
    trajectories = scene.trajectories
    instants, first = np.unique(trajectories.time_s, return_index=True)
    for now, rows in zip(instants, np.split(np.arange(len(trajectories)), first[1:]), strict=True):
        velocity = (
            trajectories.velocity[rows] if true_velocities and trajectories.velocity is not None else None
        )
        yield predictor.update(float(now), trajectories.track_id[rows], trajectories.position[rows], velocity)


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
    paths = np.full((len(order), horizon_steps, 2), np.nan)
    covariance = np.full((*paths.shape, 2), np.nan)
    for forecast in forecasts:
        span = forecast.time_s - TIME_TOLERANCE_S, forecast.time_s + TIME_TOLERANCE_S
        rows = order[slice(*np.searchsorted(sorted_s, span))]
        rows = rows[np.isin(track_id[rows], forecast.track_id)]
        own = np.searchsorted(forecast.track_id, track_id[rows])
        paths[rows] = forecast.position[own]
        if forecast.covariance is not None:
            covariance[rows] = forecast.covariance[own]
    return Predictions.single(paths, dt_s, None if np.isnan(covariance).all() else covariance)


def as_windows(
    scene: Scene, forecasts: Iterable[Forecast], method: str, sizes: FeatureSettings
) -> EvaluationWindows:
    """Arrange forecasts as rows beside the paths that people took.

    Args:
        scene: knows these paths; where one ends, its last position stands for the rest.
        forecasts: at any instants of it.
        method: what to call them.
        sizes: of the forecasts.

    Returns:
        One row per person and forecast; the grids are left empty.
    """
    known = [forecast for forecast in forecasts if len(forecast)]
    steps, dt_s = sizes.horizon_steps, sizes.dt_s
    track_id = _joined([forecast.track_id for forecast in known], (), np.int64)
    time_s = np.repeat([forecast.time_s for forecast in known], [len(forecast) for forecast in known])
    path = _joined([forecast.position for forecast in known], (steps, 2), np.float64)
    first = _joined([forecast.velocity for forecast in known], (steps, 2), np.float64)[:, 0]
    ahead_s = (np.arange(steps) + 1) * dt_s
    truth, _ = Futures.of(scene.trajectories, sizes.lost_after_s).after(track_id, time_s, ahead_s)
    given = [forecast.covariance for forecast in known if forecast.covariance is not None]
    rows = len(track_id)
    return EvaluationWindows(
        track_id=track_id,
        time_s=time_s,
        position=path[:, 0] - first * dt_s,
        heading_rad=np.zeros(rows),
        velocity=first,
        packed_grid=np.zeros((rows, 0), np.uint8),
        angular_grid_m=np.zeros((rows, 0)),
        truth=truth,
        predictions={method: Predictions.single(path, dt_s, np.concatenate(given) if given else None)},
        dt_s=dt_s,
        grid_cells=0,
        grid_resolution_m=sizes.grid_resolution_m,
        max_range_m=sizes.max_range_m,
    )


def _joined(parts: list[np.ndarray], shape: tuple[int, ...], dtype: type) -> np.ndarray:
    return np.concatenate(parts) if parts else np.zeros((0, *shape), dtype)
