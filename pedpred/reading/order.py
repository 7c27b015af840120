"""Texts without a header: which of the first two columns holds ids, by how people move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.reading.errors import ContentError

_CLEAR = 2.0
"""In one order people must go shorter steps, or be seen more often, than in the other by this factor."""
_FEWEST_ROWS = 10


def ids_come_first(first: np.ndarray, second: np.ndarray, position: np.ndarray) -> bool:
    """Find out which of two columns holds ids, the other one holding frames.

    Args:
        first: a column of whole numbers. [M]
        second: another one. [M]
        position: in any unit. [M, 2]

    Raises:
        ContentError: the file could be read in both ways.
    """
    one, other = _Motion.of(first, second, position), _Motion.of(second, first, position)
    shorter = _clearly_less(one.usual_step, other.usual_step)
    if shorter is None:
        ids_first = _clearly_less(other.seen, one.seen)
    else:
        ids_first = shorter if _clearly_less(one.long_step, other.long_step) is shorter else None
    if ids_first is None:
        problem = "without a header, the first two columns could be id and frame, or frame and id"
        raise ContentError(problem, "Name them: --columns id,frame,x,y, or --columns frame,id,x,y")
    return ids_first


def check_changes(x: np.ndarray, y: np.ndarray) -> None:
    """Check that x and y change, as positions do, and heights do not.

    Raises:
        ContentError: one does not.
    """
    if len(x) >= _FEWEST_ROWS:
        for number, (name, values) in enumerate({"x": x, "y": y}.items(), start=3):
            if not np.ptp(values):
                what = f"column {number} should be {name}, but it is {values[0]:g} in all lines"
                remedy = "Name the columns in order, such as --columns frame,id,x,height,y"
                raise ContentError(f"without a header, {what}", remedy)


def _clearly_less(one: float, other: float) -> bool | None:
    """Whether one of two numbers is less than the other; None where they are alike."""
    if one == other or max(one, other) < _CLEAR * min(one, other):
        return None
    return one < other


@dataclass(frozen=True)
class _Motion:
    """How tracks move, in the unit of positions and per detection.

    Attributes:
        usual_step: median step plus median change between steps; infinite if no track has two detections.
        long_step: the same of the 95th percentiles.
        seen: median number of detections of a track.
    """

    usual_step: float
    long_step: float
    seen: float

    @classmethod
    def of(cls, track_id: np.ndarray, frame: np.ndarray, position: np.ndarray) -> _Motion:
        """Measure it."""
        order = np.lexsort((frame, track_id))
        step = np.diff(position[order], axis=0)
        same = np.diff(track_id[order]) == 0
        seen = float(np.median(np.unique(track_id, return_counts=True)[1]))
        if not same.any():
            return cls(np.inf, np.inf, seen)
        change = np.linalg.norm(np.diff(step, axis=0)[same[1:] & same[:-1]], axis=-1)
        length = np.linalg.norm(step[same], axis=-1)
        usual, long = (
            float(np.percentile(length, share))
            + (float(np.percentile(change, share)) if len(change) else 0.0)
            for share in (50, 95)
        )
        return cls(usual, long, seen)
