"""Ids for detections that have none: each goes to the nearest expected person, all together."""

from __future__ import annotations

import numpy as np

from pedpred.geometry import rotate
from pedpred.tracking.matching import cheapest_pairs, distances_m
from pedpred.tracking.tracks import LOST_AFTER_S

_GATE_M, _GATE_MPS, _LARGEST_GATE_M = 0.5, 1.5, 2.0
"""A detection belongs to a person if it is at most so far from the expected place, m, plus m/s since it was
seen. Expected is the last place plus the motion before, which the last few detections give."""
_SMOOTHING_S = 0.4
_MOST_TRACKS = 2000
"""Of more, those who were seen last stay, of these those who came first. So many places of a message are
compared with them: detections that are noise fill neither memory nor time."""


class NearestTracks:
    """Global nearest neighbours within a gate (Blackman & Popoli 1999): who is who among bare places."""

    def __init__(self) -> None:
        self._next = 1
        self._track_id, self._seen_s = np.zeros(0, np.int64), np.zeros(0)
        self._position, self._velocity = np.zeros((0, 2)), np.zeros((0, 2))

    def assign(self, time_s: float, position: np.ndarray) -> np.ndarray:
        """Number the people of one message; a person not seen for `LOST_AFTER_S` gets a new number.

        Args:
            time_s: of the message, s; after a jump back all are forgotten.
            position: m; those that are not finite, or too many, get numbers of their own. [D, 2]

        Returns:
            [D] int64, from 1
        """
        if len(self._seen_s) and time_s < self._seen_s.max() - LOST_AFTER_S:
            self._keep(np.zeros(len(self._seen_s), bool))
        self._keep(time_s - self._seen_s <= LOST_AFTER_S)
        self._keep(np.sort(np.lexsort((self._track_id, -self._seen_s))[:_MOST_TRACKS]))
        gap_s = np.maximum(time_s - self._seen_s, 0.0)
        expected = self._position + gap_s[:, None] * self._velocity
        track_id = np.zeros(len(position), np.int64)
        placed = np.flatnonzero(np.isfinite(position).all(axis=1))[:_MOST_TRACKS]
        apart = distances_m(expected, position[placed])
        within = apart <= np.minimum(_GATE_M + _GATE_MPS * gap_s, _LARGEST_GATE_M)[:, None]
        rows, columns = np.flatnonzero(within.any(axis=1)), np.flatnonzero(within.any(axis=0))
        near = np.ix_(rows, columns)  # all others are paired with nobody, at whatever cost
        person, detection = cheapest_pairs(np.where(within[near], apart[near], 2.0 * _LARGEST_GATE_M))
        person, detection = rows[person], columns[detection]
        chosen = within[person, detection]
        person, detection = person[chosen], placed[detection[chosen]]
        track_id[detection] = self._track_id[person]
        self._move(person, position[detection], gap_s[person], time_s)
        new = np.flatnonzero(track_id == 0)
        track_id[new] = self._next + np.arange(len(new))
        self._next += len(new)
        self._add(track_id[new], position[new], time_s)
        return track_id

    def correct(self, turn_rad: float, shift: np.ndarray) -> None:
        """Move everybody: what was at p is at p, turned about the origin, plus the shift, m. [2]."""
        turn = np.float64(turn_rad)
        self._position, self._velocity = rotate(self._position, turn) + shift, rotate(self._velocity, turn)

    def _move(self, person: np.ndarray, position: np.ndarray, gap_s: np.ndarray, time_s: float) -> None:
        later = gap_s > 0
        person, position, gap_s = person[later], position[later], gap_s[later, None]
        step = (position - self._position[person]) / gap_s
        share = gap_s / (gap_s + _SMOOTHING_S)
        self._velocity[person] += share * (step - self._velocity[person])
        self._position[person], self._seen_s[person] = position, time_s

    def _add(self, track_id: np.ndarray, position: np.ndarray, time_s: float) -> None:
        placed = np.isfinite(position).all(axis=1)
        self._track_id = np.r_[self._track_id, track_id[placed]]
        self._position = np.r_[self._position, position[placed]]
        self._velocity = np.r_[self._velocity, np.zeros((placed.sum(), 2))]
        self._seen_s = np.r_[self._seen_s, np.full(placed.sum(), time_s)]

    def _keep(self, kept: np.ndarray) -> None:
        self._track_id, self._seen_s = self._track_id[kept], self._seen_s[kept]
        self._position, self._velocity = self._position[kept], self._velocity[kept]
