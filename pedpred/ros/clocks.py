"""Stamps of messages in the order in which a bag received them: false ones, and time that goes back."""

from __future__ import annotations

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.tracking.tracks import LOST_AFTER_S

_MOST_SHARE, _FEW = 0.1, 3
_APART_S = 2 * LOST_AFTER_S


def find_false(stamp_s: np.ndarray) -> np.ndarray:
    """Which stamps are far from those before and after, which agree; none if many are. [K] -> [K] bool."""
    false = np.zeros(len(stamp_s), bool)
    before, here, after = stamp_s[:-2], stamp_s[1:-1], stamp_s[2:]
    far = np.minimum(np.abs(here - before), np.abs(here - after)) > LOST_AFTER_S
    false[1:-1] = far & (np.abs(after - before) <= LOST_AFTER_S)
    return false if false.sum() <= max(_FEW, _MOST_SHARE * len(stamp_s)) else np.zeros_like(false)


def find_passes(stamp_s: np.ndarray) -> np.ndarray:
    """Number the stretches between which time goes back by more than a track may be lost, from 0. [K] -> [K].

    Raises:
        ValueRuleError: it goes back again and again, as where two clocks are mixed.
    """
    latest, number, passes = -np.inf, 0, np.zeros(len(stamp_s), np.int64)
    for row, stamp in enumerate(stamp_s.tolist()):
        back = stamp < latest - LOST_AFTER_S
        number, latest = (number + 1, stamp) if back else (number, max(latest, stamp))
        passes[row] = number
    if number > max(_FEW, _MOST_SHARE * len(stamp_s)):
        found = f"{number} times back in {len(stamp_s)} messages"
        rule = "time must go on: record publishers with different clocks one by one"
        raise ValueRuleError("stamp", found, rule)
    return passes


def in_a_row(stamp_s: np.ndarray, passes: np.ndarray) -> np.ndarray:
    """Times at which every pass begins after the one before, and the first one keeps its own, s. [K]."""
    time_s, end_s = stamp_s.copy(), -np.inf
    for number in range(int(passes.max(initial=0)) + 1):
        own = passes == number
        if number:
            time_s[own] += end_s + _APART_S - stamp_s[own].min()
        end_s = time_s[own].max(initial=end_s)
    return time_s
