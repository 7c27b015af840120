"""Whether tracks can be those of people: which columns hold ids and times, and the unit of lengths.

Files without a header say neither, and a header can be wrong. People walk steadily, and not faster than some
metres a second.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError, worded
from pedpred.scenes import Trajectories
from pedpred.tables.placeholders import FASTEST_MPS
from pedpred.tables.titles import naming
from pedpred.tables.units import PIXELS, UNITS
from pedpred.tracking.steps import catch_up

_log = logging.getLogger(__name__)
_CLEAR = 2.0
"""In one reading people must go shorter steps, or be seen more often, than in the other by this factor."""
_LONG_PERCENT = 95
"""Of steps; longer ones may be gaps in tracks."""
_FAR = 4.0
"""Of tracks that are too fast, steps must be shorter by this factor."""
_JUMP_MPS, _SLOWEST_MPS = 12.0, 0.2
"""Nobody runs as fast as the first. Walkers exceed a speed between the others in 1 % of the time."""
WALK_MPS = 0.5
"""Walkers exceed it."""
USUAL_MPS = 3.0
"""Where it lies at most in the unit that is meant."""
_OTHER_CAUSE = (
    "; most of them walk: are ids exchanged, does the frame of the positions jump or move, "
    "or are clocks apart?"
)
"""Of speeds that no unit explains."""
_LIKELY = ("m", "ft", "cm", "mm")
"""Units that are proposed, from the longest."""
_DEGREES_PER_S = 2e-4
"""Longitude and latitude of people who walk change by less, degrees/s."""
_REGULAR, _IRREGULAR = 1e-3, 0.1
"""A clock's steps differ by less than the first share of their median, others by more than the second."""
_FEWEST_STEPS = 5
_MOST_ROWS, _BLOCK_ROWS = 2**18, 2**16
"""How many rows are looked at for their titles, and how many at once for speeds, which bounds the memory."""
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
    by_steps = _clearly_less(one.usual_step, other.usual_step)
    if by_steps is None:
        return _clearly_less(other.seen, one.seen)
    return None if _clearly_less(one.long_step, other.long_step) is not by_steps else by_steps


def _clearly_less(one: float, other: float) -> bool | None:
    """Whether one of two numbers is less than the other; None where they are alike."""
    if one == other or max(one, other) < _CLEAR * min(one, other):
        return None
    return one < other


@dataclass(frozen=True)
class _Motion:
    """How tracks move, in the unit of positions and per detection.

    Attributes:
        usual_step: median step plus median change between steps; infinite where nobody is seen twice.
        long_step: the same of the 95th percentiles.
        seen: median number of detections of a track.
    """

    usual_step: float
    long_step: float
    seen: float


def _motion(track_id: np.ndarray, frame: np.ndarray, position: np.ndarray) -> _Motion:
    order = np.lexsort((frame, track_id))
    step = np.diff(position[order], axis=0)
    same = np.diff(track_id[order]) == 0
    seen = float(np.median(np.unique(track_id, return_counts=True)[1])) if len(track_id) else 0.0
    if not same.any():
        return _Motion(np.inf, np.inf, seen)
    change = np.linalg.norm(np.diff(step, axis=0)[same[1:] & same[:-1]], axis=-1)
    length = np.linalg.norm(step[same], axis=-1)
    usual, long = (
        float(np.percentile(length, share)) + (float(np.percentile(change, share)) if len(change) else 0.0)
        for share in (50, _LONG_PERCENT)
    )
    return _Motion(usual, long, seen)


def check_speeds(
    path: Path,
    trajectories: Trajectories,
    sure: bool = False,
    fixed: str | None = None,
    said: str | None = None,
) -> None:
    """Check that people move as fast as people do; otherwise lengths or times have another unit.

    Args:
        path: the file, for errors.
        trajectories: what was read from it, taken as metres and seconds.
        sure: the caller has said the unit, or who wrote the file, so that impossible speeds are only warned
            about.
        fixed: the unit that the format has, or pixels; None: the caller may say it.
        said: the unit that titles or comments say; None: metres, which nobody says.

    Raises:
        SourceError: they are impossible; the likely unit is named.
    """
    speed_mps = speeds_mps(trajectories)
    if not len(speed_mps):
        return
    usual_mps, jumps = float(np.percentile(speed_mps, 99)), int((speed_mps > _JUMP_MPS).sum())
    if jumps and usual_mps <= FASTEST_MPS:
        cause = "are ids exchanged, or do false detections have the ids of people?"
        _log.warning("%s: people jump %d times, at up to %.3g m/s: %s", path, jumps, speed_mps.max(), cause)
    if usual_mps <= FASTEST_MPS and _tell_repeats(path, trajectories):
        return
    likely, doubt = _likely_unit(usual_mps, said or "m"), ""
    other, walk = _other_than_metres(fixed), _walk_in(likely, said or "m", speed_mps)
    if not walk:
        doubt = _OTHER_CAUSE
    elif other:
        doubt = f": does the file hold {other}, as the format does, and seconds?"
    elif fixed or said:
        doubt = f": are lengths {likely} in place of {said or 'metres'}?"
    if usual_mps > FASTEST_MPS:
        problem = f"people move at up to {usual_mps:.3g} m/s (1 % are faster), faster than people walk"
        half_mps = float(np.median(speed_mps))
        if _SLOWEST_MPS < half_mps <= USUAL_MPS:
            problem += f", and at {half_mps:.2g} m/s half of the time, as where ids jump from one to another"
        if not sure:
            raise SourceError(path, None, problem, _about_speeds(likely, said, fixed))
        _log.warning("%s: %s%s", path, problem, doubt)
    elif usual_mps > USUAL_MPS:
        speeds = (
            f"up to {usual_mps:.3g} m/s (1 % are faster), {np.median(speed_mps):.3g} m/s half of the time"
        )
        ask = (
            doubt
            if sure or said or fixed or not walk
            else f": say {_unit(likely)} if lengths are {likely}, or {_unit('m')}"
        )
        running = ", which is running" if walk else ""
        _log.warning("%s: people move at %s%s%s", path, speeds, running, ask)
    elif said in UNITS and usual_mps < WALK_MPS < usual_mps / UNITS[said] <= USUAL_MPS:
        text = "%s: nobody moves faster than %.2g m/s if lengths are %s, as titles or comments say; %s"
        metres = f"in metres, that is {usual_mps / UNITS[said]:.2g} m/s: correct these if lengths are metres"
        _log.warning(text, path, usual_mps, said, metres)
    elif usual_mps < _SLOWEST_MPS:
        text = "%s: nobody moves faster than %.2g m/s; are lengths %s, times seconds?"
        _log.warning(text, path, usual_mps, other or "metres")


def _tell_repeats(path: Path, people: Trajectories) -> bool:
    """Warn if most people who move on after standing still catch up in one step; whether they do."""
    order = np.lexsort((people.time_s, people.track_id))
    same = np.diff(people.track_id[order]) == 0
    gap_s, way_m = (
        np.diff(people.time_s[order]),
        np.linalg.norm(np.diff(people.position[order], axis=0), axis=1),
    )
    stood = np.r_[False, same[:-1] & (way_m[:-1] == 0.0)] & same
    begins, repeats = stood & (way_m > 0.0), catch_up(stood, way_m, gap_s)
    if begins.sum() < _FEWEST_STEPS or 2 * repeats.sum() <= begins.sum():
        return False
    text = "%s: %d of %d times that people move on after standing still, they catch up in one step: %s"
    cause = "old positions are repeated under new times, so that forecasts are wrong: write each one once"
    _log.warning(text, path, repeats.sum(), begins.sum(), cause)
    return True


def _walk_in(unit: str, said: str, speed_mps: np.ndarray) -> bool:
    """Whether most of those who move would walk if lengths were in another unit than the one that is said."""
    moving_mps = speed_mps[speed_mps > _SLOWEST_MPS]
    return bool(len(moving_mps) and np.median(moving_mps) * UNITS[unit] / UNITS[said] >= WALK_MPS)


def _about_speeds(likely: str, said: str | None, fixed: str | None) -> str:
    """What to do about impossible speeds, if lengths are in the likely unit; see `check_speeds`."""
    rate, unit = worded("--rate", "rate_hz"), "the unit of times"
    if said:
        correct = f"correct them if lengths are {likely}, say {_unit(said)} if they are right"
        return f"Titles or comments say that lengths are {said}: {correct}, or correct {rate} or {unit}"
    if other := _other_than_metres(fixed):
        table = f"write a table (time,id,x,y), and give its {worded('unit: --unit', 'unit')}"
        return (
            f"Lengths of this format are {other}: if they are others here, {table}. Or correct ids or times"
        )
    if fixed:
        written = f"write them in metres, or into a table ({_unit(likely)})"
        ground = worded("--scale, --homography, ", "") if fixed == PIXELS else ""
        correct = f"Or correct {ground}{rate} or times"
        return f"Lengths are metres here: if they are {likely}, {written}. {correct}"
    pixels = f"{worded('--scale', 'scale them')} if they are pixels"
    say = f"Say {_unit(likely)} if lengths are {likely}, {_unit('m')} if they are metres, {pixels}"
    columns = worded("--columns", "table.columns")
    return f"{say}, or correct these, ids, {rate}, {unit} or the order of {columns}"


def _other_than_metres(fixed: str | None) -> str | None:
    """The unit that a format has, if it is a length and not metres."""
    return fixed if fixed in UNITS and fixed != "m" else None


def _unit(unit: str) -> str:
    return worded(f"--unit {unit}", f'unit="{unit}"')


def _likely_unit(usual_mps: float, said: str) -> str:
    """The longest unit in which people would walk, if lengths were taken as another one."""
    return next((unit for unit in _LIKELY if usual_mps * UNITS[unit] / UNITS[said] <= USUAL_MPS), "mm")


def check_degrees(path: Path, people: Trajectories) -> None:
    """Check that positions are not longitudes and latitudes.

    Args:
        path: the file, for errors.
        people: what was read from it, taken as metres and seconds.

    Raises:
        SourceError: they look like degrees.
    """
    speed_mps, largest = speeds_mps(people), np.sort(np.abs(people.position).max(axis=0, initial=0.0))
    slow = len(speed_mps) > 0 and 0.0 < np.percentile(speed_mps, 99) < _DEGREES_PER_S
    if slow and largest[0] <= 90.0 and largest[1] <= 180.0:
        place = ", ".join(f"{value:.10g}" for value in people.position[0])
        problem = f"positions such as {place} look like degrees of longitude and latitude"
        remedy = f"Project them to metres first, such as to UTM; {_unit('m')} insists on metres"
        raise SourceError(path, None, problem, remedy)


def check_titles(path: Path, people: Trajectories) -> None:
    """Check that the titles of a table are not those of other columns.

    Raises:
        SourceError: nobody moves like this, but people would if two titles were exchanged.
    """
    people = begin_of(people)
    remedy = f"Correct the titles, or name all columns in order, such as {naming('id,frame,x,y')}"
    if _are_exchanged(people):
        problem = "tracks jump; people would walk if the columns of ids and of times or frames were exchanged"
        raise SourceError(path, None, problem, remedy)
    check_places(path, people, remedy)


def check_places(path: Path, people: Trajectories, remedy: str) -> None:
    """Check that x and y hold positions, and neither times nor ids.

    Args:
        path: the file, for errors.
        people: what was read from it.
        remedy: what to do otherwise.

    Raises:
        SourceError: one of them does, or several people are always, or mostly, at one place.
    """
    if len(np.unique(people.track_id)) > 1 and not np.ptp(people.position, axis=0).any():
        place = ", ".join(f"{value:.10g}" for value in people.position[0])
        raise SourceError(path, None, f"everybody is always at ({place}): x and y hold no positions", remedy)
    people = begin_of(people)
    together, of = _instants_at_one_place(people)
    if together >= _FEWEST_STEPS and 2 * together > of:
        where = f"in {together} of {of} instants with several people, all of them are at exactly one place"
        raise SourceError(path, None, f"{where}: x and y are those of something else", remedy)
    for title, values in zip("xy", people.position.T, strict=True):
        problem = None
        if _is_clock(people, values):
            problem = f"{title} advances like a clock, and the times do not: the columns look exchanged"
        elif _holds_ids(people, values):
            problem = f"{title} holds few whole numbers, as ids do: the columns look exchanged"
        if problem:
            raise SourceError(path, None, problem, remedy)


def _instants_at_one_place(people: Trajectories) -> tuple[int, int]:
    """In how many of the instants with several people all are at the same place, and how many there are."""
    if not len(people):
        return 0, 0
    order = np.argsort(people.time_s, kind="stable")
    first = np.flatnonzero(np.diff(people.time_s[order], prepend=-np.inf))
    several = np.diff(np.r_[first, len(order)]) > 1
    place = people.position[order]
    spread = np.maximum.reduceat(place, first) - np.minimum.reduceat(place, first)
    return int((several & ~spread.any(axis=1)).sum()), int(several.sum())


def begin_of(people: Trajectories) -> Trajectories:
    """The first detections, as many as are looked at."""
    some = slice(_MOST_ROWS)
    return Trajectories(people.time_s[some], people.track_id[some], people.position[some])


def _are_exchanged(people: Trajectories) -> bool:
    """Whether steps would be shorter with ids and times exchanged, and tracks are brief or too fast."""
    as_titled = _motion(people.track_id, people.time_s, people.position)
    exchanged = _motion(people.time_s, people.track_id, people.position)
    if not _clearly_less(exchanged.usual_step, as_titled.usual_step):
        return False
    if not _clearly_less(exchanged.long_step, as_titled.long_step):  # rows of people, as on parade
        return False
    fast = as_titled.usual_step > FASTEST_MPS * people.usual_interval_s()
    if fast and as_titled.usual_step > _FAR * exchanged.usual_step:
        return True
    return bool(_clearly_less(as_titled.seen, exchanged.seen))


def _is_clock(people: Trajectories, values: np.ndarray) -> bool:
    """Whether every track has values at regular steps, one after the other, and times at irregular ones."""
    steps = []
    for column in (values, people.time_s):
        order = np.lexsort((column, people.track_id))
        steps.append(np.diff(column[order])[np.diff(people.track_id[order]) == 0])
    if len(steps[0]) < _FEWEST_STEPS:
        return False
    spread = [np.ptp(np.percentile(step, [5, 95])) / max(float(np.median(step)), 1e-12) for step in steps]
    return bool(spread[0] < _REGULAR and np.median(steps[0]) > 0.0 and spread[1] > _IRREGULAR)


def _holds_ids(people: Trajectories, values: np.ndarray) -> bool:
    """Whether values are few whole numbers, each more often than an id, none of them twice in one instant.

    An id is there once or twice, or with another value each time.
    """
    if not len(values) or (values != np.round(values)).any():
        return False
    order = np.lexsort((people.time_s, values))
    if ((np.diff(values[order]) == 0) & (np.diff(people.time_s[order]) == 0)).any():
        return False
    seen, often = (
        np.median(np.unique(column, return_counts=True)[1]) for column in (people.track_id, values)
    )
    order = np.lexsort((people.time_s, people.track_id))
    stays = (np.diff(people.track_id[order]) == 0) & (np.diff(values[order]) == 0)
    return bool((seen <= 2 or not stays.any()) and often >= 3 * seen and len(np.unique(values)) > 1)


def speeds_mps(people: Trajectories) -> np.ndarray:
    """Speeds along all tracks, each over at least `_SPAN_S`, m/s."""
    if not len(people):
        return np.zeros(0)
    order = np.argsort(people.track_id, kind="stable")  # rows are in order of time
    starts = np.diff(people.track_id[order], prepend=people.track_id[order[0]]) != 0
    clock = np.cumsum(starts) * (np.ptp(people.time_s) + 2 * _SPAN_S)
    clock += people.time_s[order]  # rises over all tracks, one after the other
    parts = []
    for first in range(0, len(order), _BLOCK_ROWS):
        now = slice(first, first + _BLOCK_ROWS)
        later = np.minimum(np.searchsorted(clock, clock[now] + _SPAN_S - 1e-6), len(order) - 1)
        row, then = order[now], order[later]
        after_s = people.time_s[then] - people.time_s[row]
        measured = (people.track_id[then] == people.track_id[row]) & (after_s >= _SPAN_S / 2)
        way_m = np.linalg.norm(people.position[then] - people.position[row], axis=-1)
        parts.append(way_m[measured] / after_s[measured])
    return np.concatenate(parts)
