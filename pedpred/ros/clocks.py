"""Stamps of messages in the order in which a bag received them: false ones, and time that goes back."""

from __future__ import annotations

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.tracking.tracks import LOST_AFTER_S

_MOST_SHARE, _FEW = 0.1, 3
_LEAP = 3.0  # usual steps; longer ones lead from one clock to another
_APART_S = 2 * LOST_AFTER_S


def find_missing(stamp_s: np.ndarray) -> np.ndarray:
    """Which stamps are zero because nobody has set them: those where all others are far from it. [K] bool."""
    zero = stamp_s == 0.0
    others = stamp_s[~zero]
    return zero if len(others) and others.min() > LOST_AFTER_S else np.zeros_like(zero)


def find_false(stamp_s: np.ndarray) -> np.ndarray:
    """Which stamps are far from those before and after, which agree; none if many are. [K] -> [K] bool."""
    false = np.zeros(len(stamp_s), bool)
    before, here, after = stamp_s[:-2], stamp_s[1:-1], stamp_s[2:]
    far = np.minimum(np.abs(here - before), np.abs(here - after)) > LOST_AFTER_S
    false[1:-1] = far & (np.abs(after - before) <= LOST_AFTER_S)
    return false if false.sum() <= max(_FEW, _MOST_SHARE * len(stamp_s)) else np.zeros_like(false)


def find_passes(stamp_s: np.ndarray) -> np.ndarray:
    """Number the stretches between which time goes back, from 0. [K] -> [K].

    Time goes back where a stamp is earlier than the latest one by more than a track may be lost, or where the
    next messages, too, are of a time from which messages were received before: a short loop. Single messages
    that come late or early, and those that fill a gap, belong to their stretch.

    Raises:
        ValueRuleError: it goes back again and again, as where two clocks are mixed.
    """
    latest, first, starts = -np.inf, 0, []
    for row, stamp in enumerate(stamp_s.tolist()):
        if stamp < latest - LOST_AFTER_S or (stamp < latest and _begins_again(stamp_s, first, row, latest)):
            first, latest = row, stamp
            starts.append(row)
        latest = max(latest, stamp)
    step_s = np.diff(stamp_s)
    leap_s = min(LOST_AFTER_S, _LEAP * float(np.median(np.abs(step_s)))) if len(step_s) else 0.0
    leaps = int((step_s > leap_s).sum())
    if min(len(starts), leaps) > max(_FEW, _MOST_SHARE * len(stamp_s)):
        counted = f"{len(starts)} times back in {len(stamp_s)} messages"
        rule = "time must go on: record publishers with different clocks one by one"
        raise ValueRuleError("stamp", counted, rule)
    passes = np.zeros(len(stamp_s), np.int64)
    passes[starts] = 1
    return passes.cumsum()


def _begins_again(stamp_s: np.ndarray, first: int, row: int, latest_s: float) -> bool:
    """Whether the next messages are of a time that a stretch, which began at `first`, has covered already."""
    next_s = stamp_s[row : row + _FEW + 1]
    if len(next_s) < 2 or next_s[-1] > latest_s or (np.diff(next_s) <= 0).any():
        return False
    covered_s = stamp_s[first:row]
    return int(((covered_s >= next_s[0]) & (covered_s <= next_s[-1])).sum()) > 1


def in_a_row(stamp_s: np.ndarray, passes: np.ndarray) -> np.ndarray:
    """Times at which every pass begins after the one before, and the first one keeps its own, s. [K]."""
    time_s, end_s = stamp_s.copy(), -np.inf
    for number in range(int(passes.max(initial=0)) + 1):
        here = passes == number
        if number:
            time_s[here] += end_s + _APART_S - stamp_s[here].min()
        end_s = time_s[here].max(initial=end_s)
    return time_s
