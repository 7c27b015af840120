"""Where people were, of which detections tell: the truth that past forecasts are compared with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.compiled import compiled
from pedpred.tracking.tracks import TIME_TOLERANCE_S

GAP_S = 1.0
"""Positions are known between detections that are at most so far apart, s."""
NEAR_S, _MANY = 0.2, 3
"""A line is fitted to the detections this near in time, s, if there are so many."""


@dataclass(frozen=True)
class Detections:
    """Where people were at some instants, world frame: time_s [M], person [M], position, m [M, 2]."""

    time_s: np.ndarray
    person: np.ndarray
    position: np.ndarray

    @classmethod
    def join(cls, parts: tuple[Detections, ...]) -> Detections:
        """All of them, sorted by person and time; instants rise from part to part."""
        nobody = np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 2))
        time_s, person, position = (
            np.concatenate([none, *(getattr(part, name) for part in parts)])
            for none, name in zip(nobody, ("time_s", "person", "position"), strict=True)
        )
        order = np.argsort(person, kind="stable")
        return cls(time_s[order], person[order], position[order])

    def since(self, time_s: float) -> Detections:
        """Those from an instant on."""
        late = self.time_s >= time_s
        return Detections(self.time_s[late], self.person[late], self.position[late])

    def at(self, person: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions of some tracks, and their noise.

        The value of a line through the detections within 0.2 s, if there are three or more and it is less
        noisy than what is interpolated.

        Returns:
            Positions, NaN between detections too far apart [Q, 2]; their variance in units of a detection's
            [Q].
        """
        return _at(self.person, self.time_s, self.position, person, time_s)


@compiled
def _at(known_id, known_s, position, person, time_s):  # pragma: no cover (compiled)
    """See `Detections.at`."""
    found, noise = np.full((len(time_s), 2), np.nan), np.ones(len(time_s))
    for q in range(len(time_s)):
        begin = np.searchsorted(known_id, person[q])
        end = np.searchsorted(known_id, person[q], side="right")
        own_s, own, now_s = known_s[begin:end], position[begin:end], time_s[q]
        after = np.searchsorted(own_s, now_s - TIME_TOLERANCE_S)
        if after == len(own_s):
            continue
        before, part = after, 0.0
        if own_s[after] > now_s + TIME_TOLERANCE_S:
            before, gap_s = after - 1, own_s[after] - own_s[after - 1]
            if before < 0 or gap_s > GAP_S + TIME_TOLERANCE_S:
                continue
            part = (now_s - own_s[before]) / gap_s
        first = np.searchsorted(own_s, now_s - NEAR_S - TIME_TOLERANCE_S)
        last = np.searchsorted(own_s, now_s + NEAR_S + TIME_TOLERANCE_S, side="right")
        found[q] = own[before] + part * (own[after] - own[before])
        noise[q] = (1.0 - part) ** 2 + part**2
        if last - first >= _MANY:
            value, variance = _on_line(own_s[first:last] - now_s, own[first:last])
            if variance < noise[q]:
                found[q], noise[q] = value, variance
    return found, noise


@compiled
def _on_line(off_s, position):  # pragma: no cover (compiled)
    """Value at 0 s of a line that is fitted to some positions, and its variance in units of theirs."""
    middle_s, spread, count = off_s.mean(), off_s.var(), len(off_s)
    value, noise = np.zeros(2), 0.0
    for k in range(count):
        share = (1.0 - (off_s[k] - middle_s) * middle_s / spread) / count
        value += share * position[k]
        noise += share * share
    return value, noise
