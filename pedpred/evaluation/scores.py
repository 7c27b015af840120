"""What one forecaster did in every evaluation window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.evaluation.calibration import negative_log_likelihood, squared_mahalanobis
from pedpred.evaluation.metrics import displacement, inside_obstacle, too_close
from pedpred.features import FeatureSettings, FeatureTable
from pedpred.geometry import rotate, rotated_covariance
from pedpred.scenes import OccupancyMap


@dataclass(frozen=True)
class Scores:
    """Per-window results, kept until the very end so that any pooling is exact.

    Attributes:
        track: which track, for the bootstrap. [W]
        moving: faster than a threshold at the window's instant. [W] bool
        error_m: displacement at each forecast step, m. [W, P]
        in_obstacle: forecast position inside an obstacle. [W, P] bool
        collides: forecast path runs into another forecast path. [W] bool
        distance2: squared Mahalanobis distance of the truth; no columns from a method that tells no
            covariance. [W, P] or [W, 0]
        nll: negative log likelihood of the truth, nats; no columns likewise. [W, P] or [W, 0]
    """

    track: np.ndarray
    moving: np.ndarray
    error_m: np.ndarray
    in_obstacle: np.ndarray
    collides: np.ndarray
    distance2: np.ndarray
    nll: np.ndarray


def windows_of(table: FeatureTable, settings: FeatureSettings, place: str) -> np.ndarray:
    """Rows of a place's evaluation windows. [W].

    Raises:
        ValueRuleError: there is none.
    """
    rows = np.flatnonzero(table.window)
    if not len(rows):
        ahead_s = settings.horizon_steps * settings.dt_s
        rule = f"nobody in {place} is detected {settings.min_history + 1} times and {ahead_s:g} s longer"
        raise ValueRuleError("windows", 0, rule)
    return rows


def true_paths(windows: FeatureTable, dt_s: float) -> np.ndarray:
    """The true path behind the targets of evaluation windows, world frame, m. [W, P, 2]."""
    walked = np.cumsum(windows.future.astype(np.float64) * dt_s, axis=1)
    return windows.position[:, None] + rotate(walked, windows.heading_rad[:, None])


def world_paths(table: FeatureTable, velocities: np.ndarray, dt_s: float) -> np.ndarray:
    """Euler integration of agent-frame velocities [M, P, 2] from the tracked positions. [M, P, 2] m."""
    walked = np.cumsum(velocities.astype(np.float64) * dt_s, axis=1)
    return table.position[:, None] + rotate(walked, table.heading_rad[:, None])


def world_covariance(table: FeatureTable, covariance: np.ndarray) -> np.ndarray:
    """Agent-frame covariances [M, P, 2, 2] in the world frame, m^2. [M, P, 2, 2]."""
    return rotated_covariance(covariance.astype(np.float64), table.heading_rad[:, None])


def score(
    windows: FeatureTable,
    truth: np.ndarray,
    paths: np.ndarray,
    occupancy: OccupancyMap,
    moving_mps: float,
    collision_m: float,
    covariance: np.ndarray | None = None,
) -> Scores:
    """Measure one forecaster in one scene.

    Args:
        windows: the evaluation windows. [W].
        truth: world frame, m. [W, P, 2]
        paths: forecast, world frame, m. [W, P, 2]
        occupancy: static obstacles.
        moving_mps: slower pedestrians count as standing, m/s.
        collision_m: forecast pedestrians nearer than this collide, m.
        covariance: of the forecast positions, world frame, m^2, where the method tells one. [W, P, 2, 2]
    """
    distance2 = nll = np.zeros((len(paths), 0))
    if covariance is not None:
        distance2 = squared_mahalanobis(truth - paths, covariance)
        nll = negative_log_likelihood(distance2, covariance)
    return Scores(
        track=windows.track_id,
        moving=np.hypot(*windows.velocity.T) > moving_mps,
        error_m=displacement(paths, truth),
        in_obstacle=inside_obstacle(paths, occupancy),
        collides=too_close(paths, windows.time_s, collision_m),
        distance2=distance2,
        nll=nll,
    )


def pooled(scores: Sequence[Scores]) -> Scores:
    """Several scenes as one; tracks of different scenes stay different."""
    track, offset = [], 0
    for part in scores:
        _, own = np.unique(part.track, return_inverse=True)
        track.append(own + offset)
        offset += own.max(initial=-1) + 1
    return Scores(
        np.concatenate(track),
        *(
            np.concatenate([getattr(part, name) for part in scores])
            for name in ("moving", "error_m", "in_obstacle", "collides", "distance2", "nll")
        ),
    )
