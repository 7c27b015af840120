"""Clocks that begin again: counters of 16 or 32 bits, and times since midnight."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError, worded
from pedpred.tables.units import PER_SECOND

_BITS, _DAY_S = (16, 32), 86_400
_LONGEST_STEPS = 10
"""A clock begins again if somebody is seen within so many usual steps at its end and at its beginning."""
_log = logging.getLogger(__name__)


def unwrapped(
    path: Path, clock: np.ndarray, track_id: np.ndarray, line: np.ndarray, unit: str | None
) -> np.ndarray:
    """Let a clock that begins again go on, with a warning.

    It begins again where somebody is detected at the end of its range and, in the next line about the same
    person, at its beginning.

    Args:
        path: the file, for messages.
        clock: frames, or times in the unit, in the order of the lines. [M]
        track_id: likewise. [M]
        line: likewise. [M]
        unit: of times; None: frames.

    Returns:
        The clock without jumps. [M]

    Raises:
        SourceError: the rows are not in order of time, so that it stays open how often the clock has begun
            again before them.
    """
    order = np.argsort(track_id, kind="stable")
    step, same = np.diff(clock[order]), np.diff(track_id[order]) == 0
    back, forward = np.flatnonzero(same & (step < 0)), step[same & (step > 0)]
    if not len(back) or not len(forward):
        return clock
    longest, least, most = _LONGEST_STEPS * float(np.median(forward)), clock.min(), clock.max()
    for first, period in _ranges(unit):
        onward = step[back] + period
        begins = order[back[(onward > 0) & (onward <= longest)]]
        if len(begins) and first <= least and most < first + period and 4 * longest < period:
            before = begins[np.argmin(line[begins])]
            what = "frame numbers" if unit is None else "times"
            problem = f"{what} begin again after {clock[before]:.10g} in line {line[before]}"
            turns = np.r_[0, np.cumsum(_turns(np.diff(clock), period))]
            whole = clock + period * (turns - turns.min())
            if (np.diff(whole) < -longest).any() and 2 * np.ptp(whole) >= period:
                remedy = f"Sort rows by time, or let {what} go on in the {worded('file', 'table')}"
                raise SourceError(path, None, f"{problem}, and rows are not in order of time", remedy)
            _log.warning("%s: %s: they are read as if they went on", path, problem)
            return whole
    return clock


def _ranges(unit: str | None) -> list[tuple[int, int]]:
    """The first value and the length of the ranges that clocks of this unit have."""
    day = [] if unit is None else [(0, round(_DAY_S * PER_SECOND[unit]))]
    counters = [(first, 2**bits) for bits in _BITS for first in (0, -(2 ** (bits - 1)))]
    return day if unit in ("s", "min") else [*counters, *day]


def _turns(step: np.ndarray, period: int) -> np.ndarray:
    """How often a clock begins again at each step, which is at most half of its range. [M] int64."""
    return (2 * step < -period).astype(np.int64) - (2 * step > period)
