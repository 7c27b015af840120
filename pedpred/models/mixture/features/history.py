"""Where a pedestrian was before: positions at regular times up to the present, in the agent frame."""

from __future__ import annotations

import math

import numpy as np

from pedpred.compiled import compiled
from pedpred.tracking.tracks import TIME_TOLERANCE_S

PAST = 3
"""Numbers per past position: (forward, left), m, and 1 where it is known."""


def past_positions(
    trail_s: np.ndarray,
    trail: np.ndarray,
    first: np.ndarray,
    last: np.ndarray,
    seen_s: np.ndarray,
    seen: np.ndarray,
    now_s: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
    heading_rad: np.ndarray,
    steps: int,
    dt_s: float,
) -> np.ndarray:
    """Positions 0, dt_s, 2 dt_s, ... before the present, interpolated between detections.

    After the last detection the tracked motion stands for it; before the first one nothing is known.

    Args:
        trail_s: kept detections (`pedpred.tracking.spacing`) of all people, each one's in the order of
            time, s. [T]
        trail: their positions, world frame, m. [T, 2]
        first: row of each person's first detection of the same life in the trail. [Q]
        last: one past the row of the last one before `seen_s`. [Q]
        seen_s: time of the last detection, s. [Q]
        seen: its position, m. [Q, 2]
        now_s: the present, s. [Q]
        position: tracked at the present, m. [Q, 2]
        velocity: tracked, m/s. [Q, 2]
        heading_rad: of the agent frame. [Q]
        steps: number of earlier times H.
        dt_s: time between them, s.

    Returns:
        (forward, left) m and 1; zeros where unknown. [Q, H + 1, PAST] float32
    """
    past = np.zeros((len(now_s), steps + 1, PAST), np.float32)
    _look_back(
        trail_s, trail, first, last, seen_s, seen, now_s, position, velocity, heading_rad, dt_s, past
    )  # fmt: skip
    return past


@compiled
def _look_back(
    trail_s, trail, first, last, seen_s, seen, now_s, position, velocity, heading_rad, dt_s, past
):  # pragma: no cover (compiled)
    """Writes into `past`; number by number, since writing tuples takes seconds to compile."""
    for q in range(len(now_s)):
        cos, sin = math.cos(heading_rad[q]), math.sin(heading_rad[q])
        after_s, ahead_x, ahead_y = seen_s[q], seen[q, 0], seen[q, 1]
        row = last[q] - 1
        for k in range(past.shape[1]):
            then_s = now_s[q] - k * dt_s
            while row >= first[q] and after_s > then_s + TIME_TOLERANCE_S:
                if trail_s[row] <= then_s + TIME_TOLERANCE_S:
                    break
                after_s, ahead_x, ahead_y = trail_s[row], trail[row, 0], trail[row, 1]
                row -= 1
            if after_s <= then_s + TIME_TOLERANCE_S:  # the last detection is older: extrapolate
                late_s = then_s - now_s[q]
                x, y = position[q, 0] + late_s * velocity[q, 0], position[q, 1] + late_s * velocity[q, 1]
                if after_s >= then_s - TIME_TOLERANCE_S:
                    x, y = ahead_x, ahead_y
            elif row < first[q]:
                break
            else:
                share = (then_s - trail_s[row]) / (after_s - trail_s[row])
                x = trail[row, 0] + share * (ahead_x - trail[row, 0])
                y = trail[row, 1] + share * (ahead_y - trail[row, 1])
            x, y = x - position[q, 0], y - position[q, 1]
            past[q, k, 0], past[q, k, 1], past[q, k, 2] = cos * x + sin * y, cos * y - sin * x, 1.0
