"""Check that tracks can be those of people: `check`, for files, bags, data frames and scene folders."""

from __future__ import annotations

import logging

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.reading.errors import ContentError
from pedpred.scenes import Trajectories

FASTEST_MPS = 6.0
"""Faster than any pedestrian."""
_RUNNING_MPS, _SLOWEST_MPS, _JUMP_MPS = 3.0, 0.1, 12.0
_LONGEST_S = 5.0
"""Longest usual time between two detections of a pedestrian that can be seconds."""
_TOO_LONG = {5e6: "nanoseconds", 5e3: "microseconds", _LONGEST_S: "milliseconds or frame numbers"}
_SPAN_S = 0.4
"""Speeds are measured over this time at least, so that noise and short steps do not count."""
_log = logging.getLogger(__name__)


def check(people: Trajectories, name: str, unit: str = "m", any_speed: bool = False) -> float:
    """Check tracks, and return the usual time between two detections of one, s.

    Args:
        people: tracks in metres and seconds.
        name: of the file or topic, for messages.
        unit: of the lengths before they were converted.
        any_speed: only warn of people who are faster than people walk.

    Raises:
        ContentError: no track has two detections, times are not seconds, or people are too fast.
    """
    if not len(people):
        problem = "no detections: no row has an id, a time and a position"
        raise ContentError(problem, "Name a file with tracks")
    try:
        dt_s = people.usual_interval_s()
    except ValueRuleError as cause:
        remedy = "Is the right column used as id? Name it: --columns id=TITLE"
        raise ContentError(str(cause), remedy) from cause
    _check_interval(dt_s)
    _check_speeds(people, name, unit, any_speed)
    return dt_s


def _check_interval(dt_s: float) -> None:
    for least, unit in _TOO_LONG.items():
        if dt_s >= least:
            problem = f"a track is usually detected every {dt_s:g} s: this looks like {unit}"
            remedy = "Call the column t_ms, t_us or t_ns, or frame, and give its rate: --rate (rate_hz)"
            raise ContentError(problem, remedy)


def _check_speeds(people: Trajectories, name: str, unit: str, any_speed: bool) -> None:
    speed_mps = speeds_mps(people)
    if not len(speed_mps):
        return
    usual_mps, half_mps = np.percentile(speed_mps, (99, 50)).tolist()
    speeds = f"people move at up to {usual_mps:.3g} m/s (1 % are faster), {half_mps:.3g} m/s half of the time"
    if usual_mps > FASTEST_MPS and not any_speed:
        lengths = "--unit if lengths are not metres, " if unit == "m" else ""
        remedy = f"Give {lengths}--rate if the frame rate differs, or --any-speed to read it as it is"
        raise ContentError(f"{speeds}, faster than people walk", remedy)
    if usual_mps > _RUNNING_MPS:
        _log.warning("%s: %s", name, speeds)
    elif usual_mps < _SLOWEST_MPS:
        _log.warning("%s: all people are slower than %.2g m/s", name, usual_mps)
    if usual_mps <= FASTEST_MPS and (jumps := int((speed_mps > _JUMP_MPS).sum())):
        _log.warning("%s: people jump %d times, at up to %.3g m/s", name, jumps, speed_mps.max())


def speeds_mps(people: Trajectories) -> np.ndarray:
    """Speeds along all tracks, each over at least `_SPAN_S`, m/s."""
    if not len(people):
        return np.zeros(0)
    order = np.argsort(people.track_id, kind="stable")  # rows are in order of time
    track_id, time_s = people.track_id[order], people.time_s[order]
    starts = np.diff(track_id, prepend=track_id[0]) != 0
    clock = time_s + np.cumsum(starts) * (np.ptp(time_s) + 2 * _SPAN_S)  # rises over all tracks
    later = np.minimum(np.searchsorted(clock, clock + _SPAN_S - 1e-6), len(clock) - 1)
    after_s = time_s[later] - time_s
    measured = (track_id[later] == track_id) & (after_s >= _SPAN_S / 2)
    rows, then = order[measured], order[later[measured]]
    way_m = np.linalg.norm(people.position[then] - people.position[rows], axis=-1)
    return np.asarray(way_m / after_s[measured])
