"""The recent detections of the people that a robot tracks, as arrays of one row per person."""

from __future__ import annotations

import math

import numpy as np

from pedpred.features import FeatureSettings
from pedpred.features.history import SPACING_S
from pedpred.features.situation import Past
from pedpred.tracking.tracks import TIME_TOLERANCE_S

Arrays = dict[str, np.ndarray]
"""Name -> [N, ...]:
trail_s: times of the kept detections before the last one, -inf in front of the first one, s. [N, T]
trail: their positions, world frame, m. [N, T, 2]
detection: the last one, m. [N, 2]
last_velocity: from the last two detections, m/s. [N, 2]
age: number of detections before the last one. [N] int64
kept: whether the last one will be kept (`pedpred.features.history.spaced`). [N] bool
"""


def slots_for(sizes: FeatureSettings) -> int:
    """Kept detections T that a history needs."""
    return math.ceil(sizes.history_steps * sizes.dt_s / SPACING_S) + 2


def first_seen(position: np.ndarray, slots: int) -> Arrays:
    """The past of people who have just been detected for the first time at some positions [N, 2]."""
    people = len(position)
    return {
        "trail_s": np.full((people, slots), -np.inf),
        "trail": np.zeros((people, slots, 2)),
        "detection": position,
        "last_velocity": np.zeros((people, 2)),
        "age": np.zeros(people, np.int64),
        "kept": np.ones(people, bool),
    }


def seen_again(past: Arrays, seen_s: np.ndarray, time_s: float, position: np.ndarray) -> Arrays:
    """The past of some people after another detection.

    Args:
        past: before it.
        seen_s: time of the detection before, s. [N]
        time_s: of the new one, s.
        position: of the new one, world frame, m. [N, 2]
    """
    kept, trail_s, trail = past["kept"][:, None], past["trail_s"], past["trail"]
    trail_s = np.where(kept, np.concatenate([trail_s[:, 1:], seen_s[:, None]], axis=1), trail_s)
    longer = np.concatenate([trail[:, 1:], past["detection"][:, None]], axis=1)
    trail = np.where(kept[..., None], longer, trail)
    return {
        "trail_s": trail_s,
        "trail": trail,
        "detection": position,
        "last_velocity": (position - past["detection"]) / (time_s - seen_s)[:, None],
        "age": past["age"] + 1,
        "kept": time_s - trail_s[:, -1] >= SPACING_S - TIME_TOLERANCE_S,
    }


def earliest(past: Arrays, rows: np.ndarray) -> np.ndarray:
    """The first kept detections of some people, m. [R, 2]."""
    known = np.isfinite(past["trail_s"][rows])
    oldest = np.take_along_axis(past["trail"][rows], known.argmax(axis=1)[:, None, None], axis=1)[:, 0]
    return np.where(known.any(axis=1, keepdims=True), oldest, past["detection"][rows])


def past_of(past: Arrays, rows: np.ndarray, seen_s: np.ndarray, covariance: np.ndarray) -> Past:
    """What networks read of some people.

    Args:
        past: of everybody.
        rows: whose. [Q]
        seen_s: time of everybody's last detection, s. [N]
        covariance: of everybody's track. [N, 3]
    """
    slots = past["trail_s"].shape[1]
    span = np.empty((len(rows), 2), np.int64)
    span[:, 1] = (rows + 1) * slots
    span[:, 0] = span[:, 1] - np.isfinite(past["trail_s"][rows]).sum(axis=1)
    return Past(
        past["trail_s"].ravel(),
        past["trail"].reshape(-1, 2),
        span,
        seen_s[rows],
        past["detection"][rows],
        past["last_velocity"][rows],
        covariance[rows],
        past["age"][rows],
    )
