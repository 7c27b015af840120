"""Whether the times of tracks can be seconds."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError, worded
from pedpred.scenes import Trajectories
from pedpred.tables.clocks import other_times

_LONGEST_S = 5.0
"""Longest usual time between two detections of a pedestrian that can be seconds."""
_TOO_LONG = {5e6: "nanoseconds", 5e3: "microseconds", _LONGEST_S: "milliseconds or frame numbers"}
_LATEST_HHMMSS, _NEAR = 240_000, 3
"""Of hours, minutes and seconds in one number: their end, and how many usual steps may lie between two."""
_WITH_COLONS = "Write times as seconds, or with colons, such as 14:02:07.5"
_BRIEF_S, _FASTEST_MPS, _SLOW_MPS = 0.4, 12.0, 0.5
_LONGER = {"minutes": 60.0, "hours": 3600.0, "days, as of spreadsheets": 86400.0}
"""Other units of time: how many seconds they have."""
_log = logging.getLogger(__name__)


def check_clock(path: Path, dt_s: float) -> None:
    """Check that the usual time between two detections of a track can be seconds.

    Raises:
        SourceError: it is too long; the message names what it looks like.
    """
    for least, unit in _TOO_LONG.items():
        if dt_s >= least:
            problem = f"a track is usually detected every {dt_s:g} s: this looks like {unit}"
            raise SourceError(path, None, problem, other_times())


def check_digits(path: Path, people: Trajectories) -> None:
    """Check that times are not hours, minutes and seconds in one number, such as 140259.9 before 140300.0.

    Args:
        path: the file, for errors.
        people: what was read from it.

    Raises:
        SourceError: the last two digits before the point never exceed 59, and people are seen before and
            after a leap that this makes.
    """
    time_s = people.time_s
    if not len(people) or time_s.min() < 0 or time_s.max() >= _LATEST_HHMMSS:
        return
    if (time_s % 100 >= 60).any() or (time_s % 10_000 >= 6000).any():
        return
    order = np.argsort(people.track_id, kind="stable")  # rows are in order of time
    before, after = time_s[order][:-1], time_s[order][1:]
    same = np.diff(people.track_id[order]) == 0
    step_s = after - before
    real_s = _of_digits(after) - _of_digits(before)
    longest_s = _NEAR * float(np.median(step_s[same])) if same.any() else 0.0
    leaps = same & (step_s > real_s) & (real_s > 0) & (real_s <= longest_s)
    if leaps.any():
        at = int(np.argmax(leaps))
        problem = f"times leap from {before[at]:.10g} to {after[at]:.10g}"
        problem += ", as hours, minutes and seconds in one number do"
        raise SourceError(path, None, problem, _WITH_COLONS)


def _of_digits(number: np.ndarray) -> np.ndarray:
    """Seconds since midnight of hours, minutes and seconds in one number."""
    minutes = number // 100
    return 3600 * (minutes // 100) + 60 * (minutes % 100) + number % 100


def check_brief(path: Path, people: Trajectories) -> None:
    """Check that tracks of a moment, in which speeds are not measured, are not those of minutes or days.

    Args:
        path: the file, for errors.
        people: what was read from it, taken as metres and seconds.

    Raises:
        SourceError: people would cross the ground within that moment.
    """
    if not len(people) or np.ptp(people.time_s) >= _BRIEF_S:
        return
    order = np.argsort(people.track_id, kind="stable")  # rows are in order of time
    first = np.flatnonzero(np.diff(people.track_id[order], prepend=people.track_id[order[0]] - 1))
    last = np.r_[first[1:], len(order)] - 1
    way_m = np.linalg.norm(people.position[order[last]] - people.position[order[first]], axis=1)
    lasts_s = people.time_s[order[last]] - people.time_s[order[first]]
    speed_mps = float(np.median(way_m[lasts_s > 0] / lasts_s[lasts_s > 0])) if (lasts_s > 0).any() else 0.0
    if speed_mps > _FASTEST_MPS:
        likely = [unit for unit, seconds in _LONGER.items() if speed_mps / seconds < _FASTEST_MPS / 4]
        problem = (
            f"all of it lasts {np.ptp(people.time_s):.3g} s, in which people move at {speed_mps:.3g} m/s"
        )
        raise SourceError(
            path, None, f"{problem}: times look like {(likely or list(_LONGER)[-1:])[0]}", other_times()
        )


def doubt_whole_seconds(path: Path, people: Trajectories, dt_s: float) -> None:
    """Warn about times 0, 1, 2, ... between which people hardly move, as with frame numbers.

    Args:
        path: the file, for messages.
        people: what was read from it, taken as metres and seconds.
        dt_s: usual time between two detections of a track, s.
    """
    if dt_s != 1.0 or (people.time_s != np.round(people.time_s)).any():
        return
    order = np.argsort(people.track_id, kind="stable")
    same = np.diff(people.track_id[order]) == 0
    way_m = np.linalg.norm(np.diff(people.position[order], axis=0)[same], axis=1)
    if np.percentile(way_m, 99) < _SLOW_MPS:
        text = "%s: times are whole numbers, and people hardly move from one to the next: are they frames? %s"
        _log.warning(text, path, f"Then call the column frame, and give {worded('--rate', 'rate_hz')}")
