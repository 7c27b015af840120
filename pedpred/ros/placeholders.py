"""Places that stand for unknown ones, such as (0, 0) and (-999, -999): people seem to jump there, and on."""

from __future__ import annotations

import numpy as np

FASTEST_MPS = 6.0
"""Nobody walks faster."""
_METRES = (1.0, 0.01, 0.001, 0.3048, 0.0254)

_OFTEN = 3
"""Another place than those below stands for unknown ones if people jump to exactly there so often."""
_USUAL = (0, -1, *(sign * (10**digits - 1) for digits in range(2, 7) for sign in (1, -1)))
_UNKNOWN = np.outer(np.array(_USUAL, float), _METRES)
"""What programs write as x and as y where they do not know (-999); in metres, whatever the unit was."""
_TOLD = 3


def left_out(place: np.ndarray, among: int) -> str:
    """Say which places stand for unknown ones.

    Args:
        place: of the detections that are left out. [N, 2]
        among: number of all detections.
    """
    shown, counts = np.unique(place, axis=0, return_counts=True)
    most = np.argsort(-counts, kind="stable")[:_TOLD]
    places = ", ".join(f"({x:.6g}, {y:.6g})" for x, y in shown[most].tolist())
    text = f"left out: {len(place)} of {among} detections, at {places}"
    return f"{text}: people jump there and away, so that it stands for an unknown place"


def find_placeholders(
    time_s: np.ndarray, track_id: np.ndarray, position: np.ndarray, place: np.ndarray | None = None
) -> np.ndarray:
    """Find detections at places that stand for unknown ones.

    People move to such a place, and on from there, faster than anybody walks. One jump is enough for the
    usual ones; other places must be the ends of several, to the last digit. Nothing is found where most steps
    are too fast, as with lengths in another unit.

    Args:
        time_s: s. [M]
        track_id: [M] int64
        position: in a frame that does not move, m; NaN where nobody knows. [M, 2]
        place: as the file has it, if its frame is another one; None: `position`. [M, 2]

    Returns:
        [M] bool, in the order of the rows.
    """
    unknown_rows = np.zeros(len(time_s), bool)
    known = np.flatnonzero(np.isfinite(position).all(axis=1))
    order = known[np.lexsort((time_s[known], track_id[known]))]
    if len(order) < 2:
        return unknown_rows
    same = np.diff(track_id[order]) == 0
    way_m = np.linalg.norm(np.diff(position[order], axis=0), axis=1)
    too_fast = way_m > FASTEST_MPS * np.diff(time_s[order])
    if not (too_fast & same).any() or 2 * (too_fast & same).sum() > same.sum():
        return unknown_rows
    place = (position if place is None else place)[order]
    goes_on = same & (np.diff(place, axis=0) == 0).all(axis=1)
    first = np.flatnonzero(np.r_[True, ~goes_on])  # of each stay at one place
    last = np.r_[first[1:], len(order)] - 1
    before, after = np.r_[False, same][first], np.r_[same, False][last]  # the person is seen then, too
    comes, leaves = np.r_[False, too_fast][first], np.r_[too_fast, False][last]
    jumped = (before | after) & (comes | ~before) & (leaves | ~after)
    spot = place[first]
    usual = (spot[:, 0] == spot[:, 1]) & np.isin(spot[:, 0], _UNKNOWN)
    _, which, counts = np.unique(spot[jumped], axis=0, return_inverse=True, return_counts=True)
    unknown = jumped.copy()
    unknown[jumped] = usual[jumped] | (counts[which.ravel()] >= _OFTEN)
    unknown |= usual & ~(before | after) & (unknown & usual).any()  # nobody was ever seen elsewhere
    unknown_rows[order] = np.repeat(unknown, last - first + 1)
    return unknown_rows
