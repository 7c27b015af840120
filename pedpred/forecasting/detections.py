"""Detections of the last seconds: the truth that past forecasts are compared with, and lines through them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pedpred.compiled import compiled
from pedpred.tracking.tracks import TIME_TOLERANCE_S

EVERY_S = 0.3
"""Least time between instants whose forecasts are kept and compared, s."""
KNOWN = 4
"""Forecasts are kept of people who were detected at least so often lately, as in the evaluation."""
GAP_S = 1.0
"""Positions are known between detections that are at most so far apart, s."""
LEFT_AFTER_S = 1.0
"""People who are not detected for longer than the horizon and this, s, have left."""
NEAR_S, _MANY = 0.2, 3
"""A line is fitted to the detections this near in time, s, if there are so many."""


@dataclass(frozen=True)
class Detections:
    """Where people were at some instants, world frame, sorted by person and time.

    Attributes:
        time_s: [M]
        person: [M]
        position: m. [M, 2]
    """

    time_s: np.ndarray
    person: np.ndarray
    position: np.ndarray

    def append(self, time_s: float, person: np.ndarray, position: np.ndarray) -> Detections:
        """These detections and one of each person [N] at a later instant, at positions [N, 2]."""
        both = np.concatenate([self.person, person])
        order = np.argsort(both, kind="stable")
        return Detections(
            np.concatenate([self.time_s, np.full(len(person), time_s)])[order],
            both[order],
            np.concatenate([self.position, position])[order],
        )

    def since(self, time_s: float) -> Detections:
        """Those from an instant on."""
        late = self.time_s >= time_s
        return Detections(self.time_s[late], self.person[late], self.position[late])

    def people_since(self, time_s: float) -> np.ndarray:
        """Whose those from an instant on are, rising. [M]."""
        return self.person[self.time_s >= time_s]

    def at(self, person: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions of some tracks, and their noise.

        The value of a line through the detections within 0.2 s, if there are three or more and it is less
        noisy than what is interpolated.

        Returns:
            Positions, NaN between detections too far apart [Q, 2]; their variance in units of a detection's
            [Q].
        """
        return _at(*self.rows_of(person), self.time_s, self.position, time_s)

    def paths(self, person: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Positions of some tracks [N] at some times [P], see `at`. [N, P, 2]."""
        asked = np.repeat(person, len(time_s)), np.tile(time_s, len(person))
        return self.at(*asked)[0].reshape(len(person), len(time_s), 2)

    def lines(self, person: np.ndarray, time_s: float, spans_s: np.ndarray) -> Lines:
        """Fit lines to the latest detections of some tracks.

        Args:
            person: whose. [Q]
            time_s: when the lines give a position, s.
            spans_s: how long before the last detection those begin that a line is fitted to, s. [L]
        """
        begin, end = self.rows_of(person)
        some = end > begin
        followed_s = np.zeros(len(person))
        followed_s[some] = self.time_s[end[some] - 1] - self.time_s[begin[some]]
        position, velocity, missed_m = _lines(begin, end, self.time_s, self.position, time_s, spans_s)
        return Lines(position, velocity, followed_s, end - begin, missed_m)

    def rows_of(self, person: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First row and end of the detections of some tracks. [Q] each."""
        begin, end = (self.person.searchsorted(person, side) for side in ("left", "right"))
        return begin, end


NO_DETECTIONS = Detections(np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 2)))


class Instant(NamedTuple):
    """What is known of the people who are forecast at an instant.

    Attributes:
        time_s: later than all before, s.
        person: whole numbers that tell the people apart, a new one for each life of an id. [N]
        seen: who is detected at this instant, and not in a burst. [N] bool
        detections: of the last seconds, this instant included.
        looked_s: the last instant of which forecasts were kept and compared, s.
    """

    time_s: float
    person: np.ndarray
    seen: np.ndarray
    detections: Detections
    looked_s: float

    @property
    def is_look(self) -> bool:
        """Whether forecasts are kept and compared at this instant."""
        return self.time_s >= self.looked_s + EVERY_S - TIME_TOLERANCE_S


def is_in_sorted(rising: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Which values are among rising ones; `np.isin` takes ten times as long for few."""
    return rising.searchsorted(values, "left") < rising.searchsorted(values, "right")


class Lines(NamedTuple):
    """Lines through the latest detections of some tracks.

    Attributes:
        position: at an instant, m; NaN where there are no two detections to fit. [Q, L, 2]
        velocity: m/s; NaN there, too. [Q, L, 2]
        followed_s: time from the first to the last known detection, s. [Q]
        detections: how many are known. [Q]
        missed_m: from the last detection to the line at its time, m; NaN as above. [Q, L]
    """

    position: np.ndarray
    velocity: np.ndarray
    followed_s: np.ndarray
    detections: np.ndarray
    missed_m: np.ndarray


@compiled
def _at(begin, end, known_s, position, time_s):  # pragma: no cover (compiled)
    """See `Detections.at`; rows [begin, end) are the detections of each person. [Q]."""
    positions, noise = np.empty((len(time_s), 2)), np.empty(len(time_s))
    for q in range(len(time_s)):
        positions[q, 0], positions[q, 1], noise[q] = np.nan, np.nan, 1.0
        near_s, near, now_s = known_s[begin[q] : end[q]], position[begin[q] : end[q]], time_s[q]
        after = _below(near_s, now_s - TIME_TOLERANCE_S)
        if after == len(near_s):
            continue
        before, part = after, 0.0
        if near_s[after] > now_s + TIME_TOLERANCE_S:
            before, gap_s = after - 1, near_s[after] - near_s[after - 1]
            if before < 0 or gap_s > GAP_S + TIME_TOLERANCE_S:
                continue
            part = (now_s - near_s[before]) / gap_s
        first = _below(near_s, now_s - NEAR_S - TIME_TOLERANCE_S)
        last = first
        while last < len(near_s) and near_s[last] <= now_s + NEAR_S + TIME_TOLERANCE_S:
            last += 1
        noise[q] = (1.0 - part) ** 2 + part**2
        for axis in range(2):
            positions[q, axis] = near[before, axis] + part * (near[after, axis] - near[before, axis])
        if last - first >= _MANY:
            x, y, variance = _on_line(near_s[first:last], now_s, near[first:last])
            if variance < noise[q]:
                positions[q, 0], positions[q, 1], noise[q] = x, y, variance
    return positions, noise


@compiled
def _lines(begin, end, known_s, position, now_s, spans_s):  # pragma: no cover (compiled)
    """See `Detections.lines`; rows [begin, end) are the detections of each person. [Q, L, 2] each."""
    there = np.full((len(begin), len(spans_s), 2), np.nan)
    velocity = np.full((len(begin), len(spans_s), 2), np.nan)
    missed_m = np.full((len(begin), len(spans_s)), np.nan)
    for q in range(len(begin)):
        near_s, near = known_s[begin[q] : end[q]], position[begin[q] : end[q]]
        for line in range(len(spans_s)):
            first = len(near_s)
            if first > 0:
                first = _below(near_s, near_s[-1] - spans_s[line] - TIME_TOLERANCE_S)
            if len(near_s) - first < 2:
                continue
            x, y, _ = _on_line(near_s[first:], now_s, near[first:])
            later_x, later_y, _ = _on_line(near_s[first:], now_s + 1.0, near[first:])
            there[q, line, 0], there[q, line, 1] = x, y
            velocity[q, line, 0], velocity[q, line, 1] = later_x - x, later_y - y
            last_x, last_y, _ = _on_line(near_s[first:], near_s[-1], near[first:])
            missed_m[q, line] = math.hypot(near[-1, 0] - last_x, near[-1, 1] - last_y)
    return there, velocity, missed_m


@compiled
def _below(rising, least):  # pragma: no cover (compiled)
    """How many of some rising numbers are less than another one; numpy's search takes seconds to compile."""
    low, high = 0, len(rising)
    while low < high:
        middle = (low + high) // 2
        if rising[middle] < least:
            low = middle + 1
        else:
            high = middle
    return low


@compiled
def _on_line(known_s, now_s, position):  # pragma: no cover (compiled)
    """Value at an instant of a line that is fitted to some positions, and its variance in units of theirs."""
    count, total, square = len(known_s), 0.0, 0.0
    for k in range(count):
        total += known_s[k] - now_s
    middle_s = total / count
    for k in range(count):
        square += (known_s[k] - now_s - middle_s) * (known_s[k] - now_s - middle_s)
    x, y, noise, spread = 0.0, 0.0, 0.0, square / count
    for k in range(count):
        share = (1.0 - (known_s[k] - now_s - middle_s) * middle_s / spread) / count
        x, y, noise = x + share * position[k, 0], y + share * position[k, 1], noise + share * share
    return x, y, noise
