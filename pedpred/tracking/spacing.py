"""Detections of one person in quick succession: which of them count.

Differences of positions that are milliseconds apart are noise, and detections in a burst are no independent
ones. So those that follow faster than `SPACING_S` are weighted down by the filter, left out of histories,
and velocities are measured over at least that time.
"""

from __future__ import annotations

import numpy as np

from pedpred.compiled import compiled

TIME_TOLERANCE_S = 1e-6
"""Time stamps closer than this are the same instant (frame / rate is not exact in binary)."""

SPACING_S = 0.05
"""Detections of a person that follow each other faster than this, s, share the weight of one."""


@compiled
def spaced(time_s, age):  # pragma: no cover (compiled)
    """Which detections a history keeps: a life's first one, and each `SPACING_S` after the last kept one.

    So a history is bounded, whatever the rate.

    Args:
        time_s: detections sorted by (life, time), s. [M]
        age: number of earlier detections of the same life. [M]

    Returns:
        [M] bool
    """
    kept = np.empty(len(time_s), np.bool_)
    last_s = -np.inf
    for row in range(len(time_s)):
        kept[row] = age[row] == 0 or time_s[row] - last_s >= SPACING_S - TIME_TOLERANCE_S
        if kept[row]:
            last_s = time_s[row]
    return kept


@compiled
def references(time_s, age):  # pragma: no cover (compiled)
    """Row of the earlier detection that each velocity is measured from; its own row at a birth.

    That of `latest_apart` among those kept (`spaced`).

    Args:
        time_s: detections sorted by (life, time), s. [M]
        age: number of earlier detections of the same life. [M]

    Returns:
        [M] int64
    """
    kept, row_of = spaced(time_s, age), np.arange(len(time_s))
    kept_row, kept_s = np.empty(len(time_s), np.int64), np.empty(len(time_s))
    first, end = 0, 0
    for row in range(len(time_s)):
        if age[row] == 0:
            first = end
        else:
            row_of[row] = kept_row[latest_apart(kept_s, first, end, time_s[row])]
        if kept[row]:
            kept_row[end], kept_s[end], end = row, time_s[row], end + 1
    return row_of


@compiled
def latest_apart(kept_s, first, end, now_s):  # pragma: no cover (compiled)
    """Row of the detection that a velocity at an instant is measured from.

    The latest that is at least `SPACING_S` older, so that noise is not divided by milliseconds; the first one
    if it is younger.

    Args:
        kept_s: times of the detections that a history keeps; those of the person are rows [first, end), s.
        first: row.
        end: after the last row.
        now_s: the instant, s.
    """
    row = end - 1
    while row > first and now_s - kept_s[row] < SPACING_S - TIME_TOLERANCE_S:
        row -= 1
    return row
