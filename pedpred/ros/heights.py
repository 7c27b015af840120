"""Whether z is the height in the places of people."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pedpred.errors import ValueRuleError

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
