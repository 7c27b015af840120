"""From detections and true paths to training rows: tracking, channels of a situation, targets."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pedpred.features.beams import obstacle_distances
from pedpred.features.perception import parsed_kalman
from pedpred.features.situation import tracked_situations
from pedpred.features.table import FeatureSettings
from pedpred.features.targets import Futures, future_velocities
from pedpred.geometry import rotate
from pedpred.scenes import Scene, Trajectories
from pedpred.simulation.fields import LARGEST_SEED, Range
from pedpred.tracking import KalmanSettings, Tracks, follow
from pedpred.tracking.tracks import TIME_TOLERANCE_S, last_rows
from pedpred.worlds.drawing import check_intervals, log_uniform, uniform


@dataclass(frozen=True)
class RowSettings:
    """How training rows vary.

    Attributes:
        seed: of everything but the worlds themselves.
        trackers: parameters of trackers in use.
        used_share: share of the recordings that one of those tracks.
        acceleration_noise: of other trackers, m^2/s^3; log-uniform.
        position_noise_m: of other trackers; log-uniform.
        initial_speed_mps: of other trackers.
        newborn_share: least expected share of the rows at the first detections of a track, which are rare
            where detections are many, but are what a robot sees when somebody appears.
        newborn: number of those detections.
        shifted_share: share of the rows whose map is shifted.
        shift_m: standard deviation of that shift along each axis.
    """

    seed: int = 5
    trackers: tuple[KalmanSettings, ...] = field(
        default=(KalmanSettings(0.0278, 0.0548, 1.0), KalmanSettings(0.0152, 0.0335, 1.0)),
        metadata={"each": parsed_kalman},
    )
    used_share: float = 0.4
    acceleration_noise: Range = (0.012, 0.4)
    position_noise_m: Range = (0.02, 0.15)
    initial_speed_mps: Range = (0.9, 1.1)
    newborn_share: float = 0.1
    newborn: int = 3
    shifted_share: float = 0.3
    shift_m: float = 0.06

    def __post_init__(self) -> None:
        check_intervals(self, {"(0, 100]": "acceleration_noise position_noise_m initial_speed_mps"})
        check_intervals(self, {"[0, 1000]": "newborn shift_m", f"[0, {LARGEST_SEED}]": "seed"})


@dataclass(frozen=True)
class Recipe:
    """What all training rows have in common.

    Attributes:
        rows: how they vary.
        sizes: of the channels and targets.
        standstill_mps: below this speed the heading is held, m/s.
    """

    rows: RowSettings
    sizes: FeatureSettings
    standstill_mps: float


def drawn_tracker(settings: RowSettings, rng: np.random.Generator) -> KalmanSettings:
    """Draw the parameters of a tracker."""
    if settings.trackers and rng.random() < settings.used_share:
        return settings.trackers[rng.integers(len(settings.trackers))]
    return KalmanSettings(
        log_uniform(rng, settings.acceleration_noise),
        log_uniform(rng, settings.position_noise_m),
        uniform(rng, settings.initial_speed_mps),
    )


def training_rows(
    seen: Scene,
    truth: Trajectories,
    kalman: KalmanSettings | None,
    most: int,
    recipe: Recipe,
    rng: np.random.Generator,
) -> dict[str, np.ndarray]:
    """Track the people of a scene and collect random detections whose whole future is known.

    Args:
        seen: detections, and the map.
        truth: true paths of the people whom `person_id` of the detections names.
        kalman: parameters of the tracker; None takes the true states.
        most: number of rows; fewer where there are not as many.
        recipe: sizes and variation.
        rng: source of all randomness.

    Returns:
        The channels of `tracked_situations` and `future`, m/s, agent frame, [M, P, 2]. Float32.
    """
    sizes, kind = recipe.sizes, "truth" if kalman is None else "kalman"
    tracks = follow(seen.trajectories, kind, kalman, recipe.standstill_mps, sizes.lost_after_s)
    futures = Futures.of(truth, min(sizes.truth_gap_s, sizes.lost_after_s))
    row = np.flatnonzero(_with_future(tracks, futures, sizes.horizon_steps * sizes.dt_s))
    chance = _chances(tracks.age[row] < recipe.rows.newborn, recipe.rows.newborn_share)
    row = np.sort(rng.choice(row, min(most, len(row)), replace=False, p=chance))
    time_s, position, heading = tracks.time_s[row], tracks.position[row], tracks.heading_rad[row]
    longest_s = seen.detection_dt_s * sizes.max_age_intervals
    channels = tracked_situations(tracks, row, time_s, seen.occupancy, sizes, longest_s)
    moved = rng.random(len(row)) < recipe.rows.shifted_share
    beside = position[moved] + rng.normal(0.0, recipe.rows.shift_m, (moved.sum(), 2))
    channels["beams"][moved] = obstacle_distances(
        seen.occupancy, beside, heading[moved], sizes.beams, sizes.beam_range_m
    )
    ahead_s = (np.arange(sizes.horizon_steps) + 1) * sizes.dt_s
    path, _ = futures.after(tracks.person_id[row], time_s, ahead_s)
    future = rotate(future_velocities(position, path, sizes.dt_s), -heading[:, None])
    return channels | {"future": future.astype(np.float32)}


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
