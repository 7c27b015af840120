"""Whether the ids in messages of people say who is who."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import Trajectories
from pedpred.tracking.matching import cheapest_pairs, distances_m
from pedpred.tracking.tracks import FASTEST_MPS, JUMP_M

_REMEDY = "record the topic of a tracker, whose ids stay with people, such as people_msgs/People with names"
_LONGEST_S, _SAVED_M, _MOST_PEOPLE = 1.0, 0.5, 500
_SWAP_MPS, _FITS_SHARE, _WALKING_MPS = 4.0, 0.2, 3.0
"""People who walked have swapped their places in the list if several are farther from where they are expected
than such a speed explains, and if each is nearer to where another one is, by this factor."""

_JUMPING, _FITTING, _NOISE_M, _ENOUGH = 0.2, 0.8, 0.2, 1000
"""Ids change hands if more than the first share of steps is one of swaps, and if for more than the second
share of these the cheapest pairs with the people of the next instant walk, within this error of detections,
or the same id walks if every other detection is left out, by no more than `_BACK` of the steps between. So
many such steps are looked at."""
_BACK = 0.5


def check_identity(ids: Sequence[Sequence[str]], time_s: np.ndarray, position: Sequence[np.ndarray]) -> None:
    """Check that ids stay with people.

    Args:
        ids: of the people in each message.
        time_s: of the messages. [K]
        position: of the people in each message, m. [n, 2] each

    Raises:
        ValueRuleError: nobody has an id, no id is in two messages, most messages give one to several people,
            or ids are places in a list, so that people become each other when one of them leaves.
    """
    named = [each for each in ids if each]
    if named and not any(name for each in named for name in each):
        raise ValueRuleError("id", "", f"it must say who is who: {_REMEDY}")
    count = sum(len(set(each)) for each in named)
    if len(named) > 1 and len(set().union(*named)) == count:
        counted = f"{count} ids in {len(named)} messages"
        raise ValueRuleError("id", counted, f"each is there once, so nobody is followed: {_REMEDY}")
    several = [each for each in named if len(each) > 1]
    shared = [each for each in several if len(set(each)) < len(each)]
    if 2 * len(shared) > len(several):
        raise ValueRuleError("id", list(shared[0]), f"people must have different ones: {_REMEDY}")
    if any(all(_counted(each, first) for each in named) for first in (0, 1)):
        _check_places(ids, time_s, position)


def check_steps(people: Trajectories) -> None:
    """Check that people do not jump to where others were, again and again, as where ids are dealt out anew.

    Nor away and back, as where two trackers send the same ids.

    Raises:
        ValueRuleError: people jump as the ids say, and walk if each one's next place is another one's, or if
            every other detection is left out.
    """
    order = np.lexsort((people.time_s, people.track_id))
    time_s, place = people.time_s[order], people.position[order]
    gap_s, way_m = np.diff(time_s), np.linalg.norm(np.diff(place, axis=0), axis=1)
    is_step = (np.diff(people.track_id[order]) == 0) & (gap_s <= _LONGEST_S)
    is_jump = is_step & _are_far(way_m, gap_s)
    if is_jump.sum() <= _JUMPING * is_step.sum():
        return
    returns = _return(time_s, place, is_step)
    steps = np.flatnonzero(is_step)
    steps = steps[np.argsort(time_s[steps + 1], kind="stable")]
    instants = np.split(steps, np.flatnonzero(np.diff(time_s[steps + 1])) + 1)
    looked = fitting = 0
    for rows in (rows for rows in instants if is_jump[rows].any() and len(rows) <= _MOST_PEOPLE):
        exchanged = find_exchanged(place[rows], place[rows + 1], gap_s[rows]) | returns[rows]
        looked, fitting = looked + int(is_jump[rows].sum()), fitting + int((is_jump[rows] & exchanged).sum())
        if looked >= _ENOUGH:
            break
    if fitting > _FITTING * looked:
        counted = f"{is_jump.sum()} of {is_step.sum()} steps lead to where another one was"
        seem = "here they seem to be places in a list, or those of two trackers"
        raise ValueRuleError("id", counted, f"ids must stay with people, and {seem}: {_REMEDY}")


def find_exchanged(before: np.ndarray, after: np.ndarray, gap_s: np.ndarray) -> np.ndarray:
    """Find people who jump to where others were, and others to where these were, as ids say.

    Args:
        before: where the same ids were, m. [N, 2]
        after: where they are in one message, m. [N, 2]
        gap_s: time between both, s. [N]

    Returns:
        [N] bool
    """
    exchanged = _are_far(np.linalg.norm(after - before, axis=1), gap_s)
    rows = np.flatnonzero(exchanged & np.isfinite(before).all(axis=1))[:_MOST_PEOPLE]
    exchanged[:] = False
    if len(rows) > 1:
        apart_m = distances_m(before[rows], after[rows])
        walk = apart_m[cheapest_pairs(apart_m)] <= _NOISE_M + _WALKING_MPS * gap_s[rows]
        exchanged[rows] = walk
    return exchanged


def _are_far(way_m: np.ndarray, gap_s: np.ndarray) -> np.ndarray:
    """Which steps are longer than people make. [N] bool."""
    return np.asarray(way_m > np.maximum(_SAVED_M, _SWAP_MPS * gap_s))


def _return(time_s: np.ndarray, place: np.ndarray, is_step: np.ndarray) -> np.ndarray:
    """Which steps, of those between rows, lead to where the id was before, or away from where it is next."""
    near = np.zeros(len(is_step) + 1, bool)  # of step k - 1 and the next one
    gap_s, way_m = time_s[2:] - time_s[:-2], np.linalg.norm(place[2:] - place[:-2], axis=1)
    step_m = np.linalg.norm(np.diff(place, axis=0), axis=1)
    walks = way_m <= np.minimum(_NOISE_M + _WALKING_MPS * gap_s, _BACK * np.minimum(step_m[:-1], step_m[1:]))
    near[1:-1] = is_step[:-1] & is_step[1:] & walks
    return near[:-1] | near[1:]


def _counted(ids: Sequence[str], first: int) -> bool:
    """Whether ids number a list."""
    return list(ids) == [str(number + first) for number in range(len(ids))]


def _check_places(ids: Sequence[Sequence[str]], time_s: np.ndarray, position: Sequence[np.ndarray]) -> None:
    """Check that nobody jumps to where another one was, and above all not when one comes or leaves."""
    there = [row for row, each in enumerate(ids) if each]
    velocity: np.ndarray | None = None
    for before, after in pairwise(there):
        old, new, gap_s = position[before], position[after], time_s[after] - time_s[before]
        known, velocity = velocity, None
        if not 0 < gap_s <= _LONGEST_S or max(len(old), len(new)) > _MOST_PEOPLE:
            continue
        expected = old if known is None else old + gap_s * known
        walked = known is not None and (np.linalg.norm(known, axis=1) < _WALKING_MPS).all()
        swap_m = max(_SAVED_M, _SWAP_MPS * gap_s) if walked else np.inf
        if not _keeps_order(expected, new, known is not None, FASTEST_MPS * gap_s + JUMP_M, swap_m):
            counted = f"{len(old)} people, then {len(new)} at {time_s[after]:g} s"
            rule = f"ids must stay with people, and here they are places in a list: {_REMEDY}"
            raise ValueRuleError("id", counted, rule)
        if len(old) == len(new):
            velocity = (new - old) / gap_s


def _keeps_order(
    expected: np.ndarray, new: np.ndarray, moving: bool, farthest_m: float, swap_m: float
) -> bool:
    """Whether people are about where they are expected, rather than where others are.

    Args:
        expected: where those of the last message should be now, m. [n, 2]
        new: where those of this one are, m. [k, 2]
        moving: whether `expected` includes how they move.
        farthest_m: nobody moves farther.
        swap_m: nobody is farther from the expected place, if nobody comes or leaves.
    """
    both = min(len(expected), len(new))
    moves = np.linalg.norm(new[:both] - expected[:both], axis=1)
    changed = moving and len(expected) != len(new) and moves.sum() > _SAVED_M
    odd = moves > (swap_m if len(expected) == len(new) else np.inf)
    if not changed and not odd.any() and not (moves > farthest_m).any():
        return True
    apart = distances_m(expected, new)
    if not np.isfinite(apart).all():
        return True
    best = apart[cheapest_pairs(apart)]
    if odd.sum() > 1 and (best[odd] < _FITS_SHARE * moves[odd]).all():
        return False
    return bool(moves.sum() - best.sum() <= _SAVED_M or not (changed or best.max() <= farthest_m))
