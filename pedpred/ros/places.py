"""Whether the places in messages can be those of people on the ground."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError, ValueRuleError
from pedpred.scenes import Trajectories
from pedpred.sources.plausibility import check_degrees
from pedpred.tables.placeholders import FASTEST_MPS
from pedpred.tables.units import UNITS

_OPTICAL = "optical"
"""In the names of frames whose z looks forward and whose y looks down (REP 103)."""
_MUCH, _FAR = 10.0, 0.1
"""People move along both axes of the ground more than their heights change, by the first factor, and by at
least the second share of how far they move along the other axis; as in tables."""
_LEAST_M = 1.0
"""Heights of people who are detected now as a whole and now in part change by less."""
_STEEPEST, _STRAIGHT = 1.0, 0.25
"""Stairs are not steeper, and people leave the line of them by a smaller share of their height."""
_STOREY_M = 2.5
_SPAN_S = 0.4
"""Over this time at least, people move farther than detectors err."""
_MOST_SHARE = (2, 98)
"""Per cent of the detections; others may be false."""


def check_heights(place: np.ndarray, who: np.ndarray, frame: str, warn: Callable[[str], object]) -> None:
    """Check that z is the height of people on one ground, after all known transforms.

    Args:
        place: of everybody, m; NaN where nobody knows. [M, 3]
        who: a number for each id. [M] int64
        frame: of the places.
        warn: is told that heights differ.

    Raises:
        ValueRuleError: x or y looks like the height, as in the frame of a camera or where y looks up.
    """
    known, is_optical = np.isfinite(place).all(axis=1), _OPTICAL in frame
    place, who = place[known], who[known]
    if not len(place):
        return
    low, high = np.percentile(place, _MOST_SHARE, axis=0)
    width_m = high - low
    climb_m = width_m[2] if is_optical else _width_m(place[:, 2] - _means(place[:, 2], who))
    for axis, other in ((1, 0), (0, 1)):
        least_m = max(_LEAST_M, _MUCH * width_m[axis], _FAR * width_m[other])
        is_steep = climb_m > least_m and not _is_slope(place[:, other], place[:, 2])
        if is_steep or (is_optical and climb_m > _LEAST_M):
            moves = f"{'xy'[axis]} changes by {width_m[axis]:.2g} m, z by {width_m[2]:.2g} m in {frame!r}"
            looks = (
                "z looks forward in frames of cameras" if is_optical else f"{'xy'[axis]} looks like a height"
            )
            table = "or write a table and say the order (--columns time,id,x,height,y)"
            rule = f"{looks}: record /tf that leads to a frame whose z looks up, {table}"
            raise ValueRuleError("position", moves, rule)
    if width_m[2] > _STOREY_M:
        heights = f"heights (z) differ by {width_m[2]:.2g} m, from {low[2]:.2g} to {high[2]:.2g} m"
        remedy = "if there are several floors, record each one alone"
        warn(f"{heights}: people who are above each other count as on one ground: {remedy}")


def _width_m(values_m: np.ndarray) -> float:
    """How far most of the values are apart, m. [M]."""
    return float(np.ptp(np.percentile(values_m, _MOST_SHARE)))


def _means(values: np.ndarray, who: np.ndarray) -> np.ndarray:
    """The mean value of each person: who stays on a floor does not climb. [M], [M] -> [M]."""
    counts = np.maximum(np.bincount(who), 1)
    return np.asarray((np.bincount(who, values) / counts)[who])


def _is_slope(way_m: np.ndarray, height_m: np.ndarray) -> bool:
    """Whether heights follow from how far people are, as on stairs or a ramp. [M], [M]."""
    if not np.ptp(way_m):
        return False
    slope, start = np.polyfit(way_m, height_m, 1)
    off_m = _width_m(height_m - slope * way_m - start)
    return bool(abs(slope) <= _STEEPEST and off_m <= _STRAIGHT * _width_m(height_m))


def check_several(people: Trajectories) -> None:
    """Check that not everybody is always at one place, as where a detector fills in another field.

    Raises:
        ValueRuleError: several people are.
    """
    if len(np.unique(people.track_id)) > 1 and not np.ptp(people.position, axis=0).any():
        rule = "everybody is always there: do the messages say in another field where people are?"
        raise ValueRuleError("position", people.position[0].tolist(), rule)


def check_lengths(path: Path, people: Trajectories) -> None:
    """Check that places are in metres, as messages define them.

    Raises:
        ValueRuleError: they look like degrees, or several people are too fast most of the time. One alone may
            be a false detection.
    """
    try:
        check_degrees(path, people)
    except SourceError as cause:
        rule = "it looks like degrees of longitude and latitude: bring people to metres, such as UTM"
        raise ValueRuleError("position", people.position[0].tolist(), rule) from cause
    usual_mps = _usual_speed_mps(people)
    if usual_mps > FASTEST_MPS and len(np.unique(people.track_id)) > 1:
        speed = f"{usual_mps:.3g} m/s half of the time"
        unit = next((unit for unit in ("cm", "mm") if usual_mps * UNITS[unit] < FASTEST_MPS), "another unit")
        doubt = f"are lengths {unit} in place of metres, or times not seconds?"
        rule = f"nobody walks so fast: {doubt} Correct them, or write a table and say its unit (--unit)"
        raise ValueRuleError("position", speed, rule)


def _usual_speed_mps(people: Trajectories) -> float:
    """How fast people move half of the time, m/s; 0 where nobody is seen for long enough to tell."""
    apart = max(1, math.ceil(_SPAN_S / people.usual_interval_s() - 1e-6))
    order = np.lexsort((people.time_s, people.track_id))
    before, after = order[:-apart], order[apart:]
    same = people.track_id[before] == people.track_id[after]
    way_m = np.linalg.norm(people.position[after] - people.position[before], axis=1)[same]
    gap_s = (people.time_s[after] - people.time_s[before])[same]
    return float(np.median(way_m / gap_s)) if same.any() else 0.0
