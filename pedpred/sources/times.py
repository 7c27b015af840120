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
