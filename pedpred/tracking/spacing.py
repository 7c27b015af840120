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

    The latest of those kept (`spaced`) that is at least `SPACING_S` older, so that noise is not divided by
    milliseconds; the life's first detection if it is younger.

    Args:
        time_s: detections sorted by (life, time), s. [M]
        age: number of earlier detections of the same life. [M]

    Returns:
        [M] int64
    """
    kept, latest_row = spaced(time_s, age), np.arange(len(time_s))
    latest = 0
    for row in range(len(time_s)):
        if age[row] == 0:
            latest = row
            continue
        for later in range(latest + 1, row):
            if time_s[row] - time_s[later] < SPACING_S - TIME_TOLERANCE_S:
                break
            if kept[later]:
                latest = later
        latest_row[row] = latest
    return latest_row
