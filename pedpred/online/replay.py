"""A recorded scene as a robot would have met it, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from pedpred.features.targets import Futures
from pedpred.online.predictor import OnlinePredictor
from pedpred.scenes import Forecast, Scene
from pedpred.storage.windows import Windows
from pedpred.tracking.tracks import TIME_TOLERANCE_S


def replayed(scene: Scene, predictor: OnlinePredictor, true_velocities: bool = False) -> Iterator[Forecast]:
    """A forecast after every frame of a scene's detections.

    Args:
        scene: a recorded place.
        predictor: forgets whatever it knew.
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


def paths_at(
    forecasts: Iterable[Forecast], track_id: np.ndarray, time_s: np.ndarray, horizon_steps: int
) -> tuple[np.ndarray, np.ndarray | None]:
    """What a replay forecasts for some people at some instants; NaN where it has nothing.

    Args:
        forecasts: in the order of time.
        track_id: whose. [W]
        time_s: when, s. [W]
        horizon_steps: P.

    Returns:
        World frame, m [W, P, 2]; m^2 [W, P, 2, 2], or None where nobody tells a covariance.
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
    return paths, None if np.isnan(covariance).all() else covariance


def as_windows(scene: Scene, forecasts: Iterable[Forecast], method: str, lost_after_s: float) -> Windows:
    """Forecasts as rows beside what really happened.

    Args:
        scene: knows the paths that people took; where one ends, its last position stands for the rest.
        forecasts: at any instants of it.
        method: what to call them.
        lost_after_s: longest silence within a path, s.

    Returns:
        One row per person and forecast; the grids are left empty.
    """
    known = [forecast for forecast in forecasts if len(forecast)]
    steps = known[0].position.shape[1] if known else 0
    dt_s = known[0].dt_s if known else 0.0
    track_id = _joined([forecast.track_id for forecast in known], (), np.int64)
    time_s = np.repeat([forecast.time_s for forecast in known], [len(forecast) for forecast in known])
    path = _joined([forecast.position for forecast in known], (steps, 2), np.float64)
    velocity = _joined([forecast.velocity for forecast in known], (steps, 2), np.float64)[:, :1]
    ahead_s = (np.arange(steps) + 1) * dt_s
    truth, _ = Futures.of(scene.trajectories, lost_after_s).after(track_id, time_s, ahead_s)
    first = velocity.reshape(-1, 2) if steps else np.zeros((0, 2))
    present = path[:, 0] - first * dt_s if steps else np.zeros((0, 2))
    told = [forecast.covariance for forecast in known if forecast.covariance is not None]
    spread = {method: np.concatenate(told)} if told else {}
    rows = len(track_id)
    empty = np.zeros((rows, 0), np.uint8), np.zeros((rows, 0))
    return Windows(track_id, time_s, present, np.zeros(rows), first, *empty, truth, {method: path}, spread)


def _joined(parts: list[np.ndarray], shape: tuple[int, ...], dtype: type) -> np.ndarray:
    return np.concatenate(parts) if parts else np.zeros((0, *shape), dtype)
