"""Whether tracks can be those of people: which of two columns holds ids, and the unit of lengths.

Files without a header say neither. People walk steadily, and not faster than some metres a second.
"""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError
from pedpred.scenes import Trajectories
from pedpred.storage.tables import UNITS

_log = logging.getLogger(__name__)
_CLEAR = 2.0
"""In one reading people must go shorter steps, or be seen more often, than in the other by this factor."""
_FASTEST_MPS, _SLOWEST_MPS = 6.0, 0.05
"""Between these lies the speed that 99 % of the time is not exceeded, where people walk."""
_USUAL_MPS = 3.0
"""Where it lies at most in the unit that is meant."""
_SPAN_S = 0.4
"""Speeds are measured over this time at least, so that noise and short steps do not count."""


def ids_come_first(first: np.ndarray, second: np.ndarray, position: np.ndarray) -> bool | None:
    """Find out which of two columns holds ids, the other one holding frames, from how people move.

    Args:
        first: a column of whole numbers. [M]
        second: another one. [M]
        position: in any unit. [M, 2]

    Returns:
        Whether the first one does; None if the file could be read in both ways.
    """
    one, other = _motion(first, second, position), _motion(second, first, position)
    by_steps = _clearly_less(one[0], other[0])
    return _clearly_less(other[1], one[1]) if by_steps is None else by_steps


def _clearly_less(one: float, other: float) -> bool | None:
    """Whether one of two numbers is less than the other; None where they are alike."""
    if one == other or max(one, other) < _CLEAR * min(one, other):
        return None
    return one < other


def _motion(track_id: np.ndarray, frame: np.ndarray, position: np.ndarray) -> tuple[float, float]:
    """Median step plus median change between steps, and how often people are seen.

    The first is infinite where nobody is seen twice.
    """
    order = np.lexsort((frame, track_id))
    step = np.diff(position[order], axis=0)
    same = np.diff(track_id[order]) == 0
    seen = float(np.median(np.unique(track_id, return_counts=True)[1])) if len(track_id) else 0.0
    if not same.any():
        return np.inf, seen
    change = np.linalg.norm(np.diff(step, axis=0)[same[1:] & same[:-1]], axis=-1)
    length = float(np.median(np.linalg.norm(step[same], axis=-1)))
    return length + (float(np.median(change)) if len(change) else 0.0), seen


def check_speeds(path: Path, trajectories: Trajectories, sure: bool = False) -> None:
    """Check that people move as fast as people do; otherwise lengths or times have another unit.

    Args:
        path: the file, for errors.
        trajectories: what was read from it, taken as metres and seconds.
        sure: the caller has said the unit, so that impossible speeds are only warned about.

    Raises:
        SourceError: they are impossible; the likely unit is named.
    """
    speed_mps = _speeds_mps(trajectories)
    if not len(speed_mps):
        return
    usual_mps = float(np.percentile(speed_mps, 99))
    if usual_mps > _FASTEST_MPS:
        likely = next((unit for unit, size_m in UNITS.items() if usual_mps * size_m <= _USUAL_MPS), "mm")
        problem = f"people move at up to {usual_mps:.0f} m/s (1 % are faster), nobody walks so fast"
        if not sure:
            remedy = (
                f"Say --unit {likely} if lengths are {likely}, --unit m if they are metres, or correct --rate"
            )
            raise SourceError(path, None, problem, remedy)
        _log.warning("%s: %s", path, problem)
    elif usual_mps < _SLOWEST_MPS:
        _log.warning(
            "%s: nobody moves faster than %.2g m/s; are lengths metres, times seconds?", path, usual_mps
        )


def _speeds_mps(people: Trajectories) -> np.ndarray:
    """Speeds along all tracks, each over at least `_SPAN_S`, m/s."""
    if not len(people):
        return np.zeros(0)
    order = np.lexsort((people.time_s, people.track_id))
    track, time_s, position = people.track_id[order], people.time_s[order], people.position[order]
    life = np.cumsum(np.append(0, np.diff(track) != 0))
    clock = time_s + life * (np.ptp(time_s) + 2 * _SPAN_S)  # rises over all tracks, one after the other
    later = np.minimum(np.searchsorted(clock, clock + _SPAN_S - 1e-6), len(track) - 1)
    measured = (track[later] == track) & (time_s[later] - time_s >= _SPAN_S / 2)
    way_m = np.linalg.norm(position[later] - position, axis=-1)[measured]
    return way_m / (time_s[later] - time_s)[measured]
