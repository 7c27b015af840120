"""Random rows of a scene: tracked people at one instant each, and their future."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pedpred.features import Surroundings, neighbours_at
from pedpred.features.targets import Futures, future_velocities
from pedpred.geometry import rotate
from pedpred.models.features import RowFormat
from pedpred.scenes import Scene, Trajectories
from pedpred.settings import LARGEST_SEED, In, Range, Settings
from pedpred.simulation.worlds.drawing import log_uniform, uniform
from pedpred.tracking import KalmanBank, KalmanSettings, Tracks, follow
from pedpred.tracking.tracks import TIME_TOLERANCE_S, last_rows

Rows = dict[str, np.ndarray]
"""Inputs of a model, and `future`, m/s, agent frame, [M, P, 2] float32."""


@dataclass(frozen=True)
class RowSettings(Settings):
    """How training rows vary.

    Attributes:
        seed: of everything but the worlds themselves.
        trackers: parameters of trackers in use.
        used_share: share of the recordings that one of those tracks.
        learning_share: share of the recordings whose tracker learns the noise of the detections.
        acceleration_noise: of other trackers, m^2/s^3; log-uniform.
        position_noise_m: of other trackers; log-uniform.
        initial_speed_mps: of other trackers.
        newborn_share: least expected share of the rows at the first detections of a track, which are rare
            where detections are many, but are what a robot sees when somebody appears.
        newborn: number of those detections.
        shifted_share: share of the rows whose map is shifted.
        shift_m: standard deviation of that shift along each axis.
    """

    seed: Annotated[int, In(f"[0, {LARGEST_SEED}]")]
    trackers: tuple[KalmanSettings, ...]
    used_share: Annotated[float, In("[0, 1]")]
    learning_share: Annotated[float, In("[0, 1]")]
    acceleration_noise: Annotated[Range, In("(0, 100]")]
    position_noise_m: Annotated[Range, In("(0, 100]")]
    initial_speed_mps: Annotated[Range, In("(0, 100]")]
    newborn_share: Annotated[float, In("[0, 1]")]
    newborn: Annotated[int, In("[0, 1000]")]
    shifted_share: Annotated[float, In("[0, 1]")]
    shift_m: Annotated[float, In("[0, 1000]")]


@dataclass(frozen=True)
class RowSampling:
    """What all rows of a set have in common.

    Attributes:
        rows: how they vary.
        row_format: protocol and inputs.
        standstill_mps: below this speed the heading is held, m/s.
    """

    rows: RowSettings
    row_format: RowFormat
    standstill_mps: float


def draw_tracker(settings: RowSettings, rng: np.random.Generator) -> KalmanBank:
    """Draw a tracker: one filter, or several that learn the noise of the detections."""
    tracker = KalmanSettings(
        log_uniform(rng, settings.acceleration_noise),
        log_uniform(rng, settings.position_noise_m),
        uniform(rng, settings.initial_speed_mps),
    )
    if settings.trackers and rng.random() < settings.used_share:
        tracker = settings.trackers[rng.integers(len(settings.trackers))]
    return KalmanBank.around(tracker, learn_noise=rng.random() < settings.learning_share)


def sample_rows(
    seen: Scene,
    truth: Trajectories,
    kalman: KalmanBank | None,
    most: int,
    sampling: RowSampling,
    rng: np.random.Generator,
) -> Rows:
    """Track the people of a scene and collect random detections whose whole future is known.

    Args:
        seen: detections, and the map.
        truth: true paths of the people whom `person_id` of the detections names.
        kalman: filters of the tracker; None takes the true states.
        most: number of rows; fewer where there are not as many.
        sampling: protocol, inputs and variation.
        rng: source of all randomness.
    """
    protocol, features = sampling.row_format.protocol, sampling.row_format.features
    kind = "truth" if kalman is None else "kalman"
    tracks = follow(seen.trajectories, kind, kalman, sampling.standstill_mps, protocol.lost_after_s)
    futures = Futures.of(truth, protocol.longest_gap_s)
    row = np.flatnonzero(_with_future(tracks, futures, protocol.horizon_steps * protocol.dt_s))
    chance = _chances(tracks.age[row] < sampling.rows.newborn, sampling.rows.newborn_share)
    row = np.sort(rng.choice(row, min(most, len(row)), replace=False, p=chance))
    time_s, position, heading = tracks.time_s[row], tracks.position[row], tracks.heading_rad[row]
    around = neighbours_at(tracks, time_s, seen.detection_dt_s * protocol.max_age_intervals)
    inputs = features.compute(Surroundings.of(tracks, row, time_s, around, seen.occupancy), protocol.dt_s)
    moved = rng.random(len(row)) < sampling.rows.shifted_share
    beside = position[moved] + rng.normal(0.0, sampling.rows.shift_m, (moved.sum(), 2))
    for name, values in features.obstacle_inputs(seen.occupancy, beside, heading[moved]).items():
        inputs[name][moved] = values
    path, _ = futures.after(tracks.person_id[row], time_s, protocol.ahead_s)
    future = rotate(future_velocities(position, path, protocol.dt_s), -heading[:, None])
    return inputs | {"future": future.astype(np.float32)}


def _chances(newborn: np.ndarray, share: float) -> np.ndarray | None:
    """Probabilities of rows that give the newborn at least a share; None: equal ones. [M] bool -> [M]."""
    usual = newborn.mean() if len(newborn) else 0.0
    if not 0.0 < usual < share or share >= 1.0:
        return None
    return np.where(newborn, share / usual, (1.0 - share) / (1.0 - usual)) / len(newborn)


def _with_future(tracks: Tracks, futures: Futures, horizon_s: float) -> np.ndarray:
    """Detections after which the true path is known for `horizon_s`. [M] bool."""
    last = last_rows(futures.person_id, futures.time_s, tracks.person_id, tracks.time_s)
    if not len(futures.time_s):
        return np.zeros(len(last), bool)
    end_s = futures.time_s[futures.last[last] - 1]
    return (last >= 0) & (tracks.time_s + horizon_s <= end_s + TIME_TOLERANCE_S)
