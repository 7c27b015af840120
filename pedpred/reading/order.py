"""Texts without a header: which of the first two columns holds ids, by how people move."""

from __future__ import annotations

import numpy as np

from pedpred.reading.errors import ContentError

_CLEAR = 2.0
"""In one order people must go shorter steps, or be seen more often, than in the other by this factor."""
_FEWEST_ROWS = 10


def check_changes(x: np.ndarray, y: np.ndarray) -> None:
    """Check that x and y change, as positions do, and heights do not.

    Raises:
        ContentError: one does not.
    """
    for number, name, values in ((3, "x", x), (4, "y", y)):
        if len(values) >= _FEWEST_ROWS and not np.ptp(values):
            what = f"column {number} should be {name}, but it is {values[0]:g} in all lines"
            remedy = "Name the columns in order, such as --columns frame,id,x,height,y"
            raise ContentError(f"without a header, {what}", remedy)


def ids_come_first(first: np.ndarray, second: np.ndarray, position: np.ndarray) -> bool:
    """Find out which of two columns holds ids, the other one holding frames.

    Args:
        first: a column of whole numbers. [M]
        second: another one. [M]
        position: in any unit. [M, 2]

    Raises:
        ContentError: the file could be read in both ways.
    """
    (usual, long, seen), (other_usual, other_long, other_seen) = (
        _motion(first, second, position),
        _motion(second, first, position),
    )
    ids_first = _is_less(usual, other_usual)
    if ids_first is None:
        ids_first = _is_less(other_seen, seen)
    elif _is_less(long, other_long) is not ids_first:
        ids_first = None
    if ids_first is None:
        problem = "without a header, the first two columns could be id and frame, or frame and id"
        raise ContentError(problem, "Name them: --columns id,frame,x,y, or --columns frame,id,x,y")
    return ids_first


def _is_less(one: float, other: float) -> bool | None:
    """Whether one of two numbers is less than the other; None where they are alike."""
    if one == other or max(one, other) < _CLEAR * min(one, other):
        return None
    return one < other


def _motion(track_id: np.ndarray, frame: np.ndarray, position: np.ndarray) -> tuple[float, float, float]:
    """Medians of step plus change of steps, and of detections of a track; between them, 95th percentiles."""
    seen = float(np.median(np.unique(track_id, return_counts=True)[1]))
    order = np.lexsort((frame, track_id))
    same = np.diff(track_id[order]) == 0
    if not same.any():
        return np.inf, np.inf, seen
    step = np.diff(position[order], axis=0)
    length = np.linalg.norm(step[same], axis=-1)
    change = np.linalg.norm(np.diff(step, axis=0)[same[1:] & same[:-1]], axis=-1)
    change = change if len(change) else np.zeros(1)
    usual, long = np.percentile(length, (50, 95)) + np.percentile(change, (50, 95))
    return float(usual), float(long), seen
