"""The recent detections of the people that a robot tracks, as arrays of one row per person."""

from __future__ import annotations

import math

import numpy as np

from pedpred.compiled import compiled
from pedpred.features.surroundings import Past
from pedpred.tracking.spacing import SPACING_S, latest_apart
from pedpred.tracking.tracks import TIME_TOLERANCE_S

Arrays = dict[str, np.ndarray]
"""Name -> [N, ...]:
trail_s: times of the kept detections before the last one, -inf in front of the first one, s. [N, T]
trail: their positions, world frame, m. [N, T, 2]
last_velocity: see `pedpred.features.surroundings.last_differences`, m/s. [N, 2]
kept: whether the last one will be kept (`pedpred.tracking.spacing`). [N] bool
"""


def slots_for(past_s: float) -> int:
    """Number of detections T to keep for inputs that look back this far, s."""
    return math.ceil(past_s / SPACING_S) + 2


def first_seen(people: int, slots: int) -> Arrays:
    """The past of people who have just been detected for the first time."""
    return {
        "trail_s": np.full((people, slots), -np.inf),
        "trail": np.zeros((people, slots, 2)),
        "last_velocity": np.zeros((people, 2)),
        "kept": np.ones(people, bool),
    }


def add_detection(
    past: Arrays, seen_s: np.ndarray, detection: np.ndarray, time_s: float, position: np.ndarray
) -> Arrays:
    """The past of some people after another detection.

    Args:
        past: before it.
        seen_s: time of the detection before, s. [N]
        detection: position of the detection before, world frame, m. [N, 2]
        time_s: of the new one, s.
        position: of the new one, world frame, m. [N, 2]
    """
    after = {name: values.copy() for name, values in past.items()}
    held = after["trail_s"], after["trail"], after["last_velocity"], after["kept"]
    _add(*held, seen_s, detection, time_s, position)
    return after


@compiled
def _add(
    trail_s, trail, last_velocity, kept, seen_s, detection, time_s, position
):  # pragma: no cover (compiled)
    """Change the past in place; see `add_detection`."""
    slots = trail_s.shape[1]
    for n in range(len(trail_s)):
        if kept[n]:
            for slot in range(slots - 1):
                trail_s[n, slot] = trail_s[n, slot + 1]
                trail[n, slot, 0], trail[n, slot, 1] = trail[n, slot + 1, 0], trail[n, slot + 1, 1]
            trail_s[n, -1] = seen_s[n]
            trail[n, -1, 0], trail[n, -1, 1] = detection[n, 0], detection[n, 1]
        first = 0
        while first < slots - 1 and trail_s[n, first] == -np.inf:
            first += 1
        slot = latest_apart(trail_s[n], first, slots, time_s)
        dt_s = max(time_s - trail_s[n, slot], SPACING_S)
        for axis in range(2):
            last_velocity[n, axis] = (position[n, axis] - trail[n, slot, axis]) / dt_s
        kept[n] = time_s - trail_s[n, -1] >= SPACING_S - TIME_TOLERANCE_S


def earliest(past: Arrays, rows: np.ndarray, detection: np.ndarray) -> np.ndarray:
    """The first kept detections of some people [R], or the last ones [R, 2] of the newborn, m. [R, 2]."""
    trail_s = past["trail_s"][rows]
    oldest = past["trail"][rows, _first_known(trail_s)]
    return np.where(np.isfinite(trail_s[:, -1:]), oldest, detection)


def kept_before(past: Arrays, rows: np.ndarray) -> np.ndarray:
    """How many detections before the last one are kept, of some people. [R]."""
    return np.isfinite(past["trail_s"][rows]).sum(axis=1)


def _first_known(trail_s: np.ndarray) -> np.ndarray:
    """Slot of each first kept detection; the last slot where there is none. [N, T] -> [N]."""
    return np.minimum(np.isinf(trail_s).sum(axis=1), trail_s.shape[1] - 1)


def past_of(
    past: Arrays, rows: np.ndarray, seen_s: np.ndarray, detection: np.ndarray, covariance: np.ndarray
) -> Past:
    """What networks read of some people.

    Args:
        past: of everybody.
        rows: whose. [Q]
        seen_s: time of everybody's last detection, s. [N]
        detection: its position, m. [N, 2]
        covariance: of everybody's track. [N, 3]
    """
    slots = past["trail_s"].shape[1]
    span = np.empty((len(rows), 2), np.int64)
    span[:, 1] = (rows + 1) * slots
    span[:, 0] = span[:, 1] - kept_before(past, rows)
    return Past(
        past["trail_s"].ravel(),
        past["trail"].reshape(-1, 2),
        span,
        seen_s[rows],
        detection[rows],
        past["last_velocity"][rows],
        covariance[rows],
    )
