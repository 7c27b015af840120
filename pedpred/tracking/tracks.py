"""What a tracker knew about every pedestrian after every detection, and asked at any later time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.errors import ConfigError, ValueRuleError
from pedpred.scenes import Recording
from pedpred.tracking.kalman import Belief, born, updated

TIME_TOLERANCE_S = 1e-6
"""Two time stamps closer than this are the same instant (frame / rate is not exact in binary)."""


@dataclass(frozen=True)
class KalmanSettings:
    """Tracker parameters of one source.

    Attributes:
        acceleration_noise: spectral density q of the white-noise acceleration, m^2/s^3.
        position_noise_m: standard deviation r of a detection, m.
        initial_speed_mps: standard deviation of a velocity component at a track's birth, m/s.
    """

    acceleration_noise: float
    position_noise_m: float
    initial_speed_mps: float = 1.0

    def __post_init__(self) -> None:
        for field in ("acceleration_noise", "position_noise_m", "initial_speed_mps"):
            if not getattr(self, field) > 0:
                raise ValueRuleError(field, getattr(self, field), "it must be positive")


@dataclass(frozen=True)
class Tracks:
    """The tracker's state after each detection, sorted by (track, time). Row k uses rows <= k only.

    Attributes:
        track_id: [M]
        time_s: of the detection, s. [M]
        age: how many detections the track had before this one. [M]
        detection: what was measured, world frame, m. [M, 2]
        position: tracked, world frame, m. [M, 2]
        velocity: tracked, world frame, m/s. [M, 2]
        heading_rad: direction of the velocity; held while standing. [M]
    """

    track_id: np.ndarray
    time_s: np.ndarray
    age: np.ndarray
    detection: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    heading_rad: np.ndarray

    def last_row(self, track_id: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Row of each track's last detection at or before a time; -1 when there is none. [Q]."""
        span = float(np.ptp(self.time_s)) + 1.0 if len(self.time_s) else 1.0
        start = self.time_s.min(initial=np.inf)
        names, index = np.unique(self.track_id, return_inverse=True)
        keys = index * 2 * span + (self.time_s - start)
        asked = np.searchsorted(names, track_id)
        elapsed = np.clip(time_s - start + TIME_TOLERANCE_S, -0.5, span)
        row = np.searchsorted(keys, asked * 2 * span + elapsed, side="right") - 1
        found = (row >= 0) & (self.track_id[np.maximum(row, 0)] == track_id)
        return np.where(found, row, -1)

    def position_at(self, row: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Position extrapolated from a row to a later time, world frame, m. [Q, 2]."""
        return self.position[row] + (time_s - self.time_s[row])[:, None] * self.velocity[row]


def follow(recording: Recording, kind: str, kalman: KalmanSettings | None, standstill_mps: float) -> Tracks:
    """Track everybody in a recording, causally.

    Args:
        recording: detections.
        kind: "kalman" filters the positions; "truth" passes a simulation's own states on.
        kalman: the filter's parameters, for kind "kalman".
        standstill_mps: below this speed a pedestrian keeps the heading it had, m/s.

    Raises:
        ConfigError: an unknown kind, or "truth" for a recording without true velocities.
    """
    order = np.lexsort((recording.time_s, recording.track_id))
    track_id, time_s = recording.track_id[order], recording.time_s[order]
    detection = recording.position[order]
    first = np.flatnonzero(np.diff(track_id, prepend=track_id[:1] - 1))
    age = np.arange(len(track_id)) - np.repeat(first, np.diff(first, append=len(track_id)))
    if kind == "kalman" and kalman is not None:
        position, velocity = _filtered(time_s, detection, first, age, kalman)
    elif kind == "truth" and recording.velocity is not None:
        position, velocity = detection, recording.velocity[order]
    else:
        raise ConfigError("tracker.kind", kind, "use 'kalman', or 'truth' where the source knows velocities")
    heading = held_heading(velocity, age, standstill_mps)
    return Tracks(track_id, time_s, age, detection, position, velocity, heading)


def _filtered(
    time_s: np.ndarray, detection: np.ndarray, first: np.ndarray, age: np.ndarray, settings: KalmanSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Run the filter over all tracks at once, one detection each at a time. [M, 2], [M, 2]."""
    position, velocity = np.empty_like(detection), np.empty_like(detection)
    covariance = np.empty((len(detection), 3))
    for k in range(int(age.max(initial=-1)) + 1):
        rows = np.flatnonzero(age == k)
        if k == 0:
            belief = born(detection[rows], settings.position_noise_m, settings.initial_speed_mps)
        else:
            before = Belief(position[rows - 1], velocity[rows - 1], covariance[rows - 1])
            dt_s = time_s[rows] - time_s[rows - 1]
            belief = updated(
                before, dt_s, detection[rows], settings.acceleration_noise, settings.position_noise_m
            )
        position[rows], velocity[rows], covariance[rows] = belief.position, belief.velocity, belief.covariance
    return position, velocity


def held_heading(velocity: np.ndarray, age: np.ndarray, standstill_mps: float) -> np.ndarray:
    """Direction of motion, or while standing the last one of the same track, else world x. [M] rad.

    Args:
        velocity: rows sorted by (track, time), world frame, m/s. [M, 2]
        age: position of each row in its track, from 0. [M]
        standstill_mps: speeds below this carry no direction, m/s.
    """
    rows = np.arange(len(velocity))
    moving = np.hypot(velocity[:, 0], velocity[:, 1]) >= standstill_mps
    latest = np.maximum.accumulate(np.where(moving, rows, -1))
    known = latest >= rows - age  # the latest motion belongs to this track
    source = velocity[np.where(known, latest, 0)]
    return np.where(known, np.arctan2(source[:, 1], source[:, 0]), 0.0)
