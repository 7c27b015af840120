"""Ids for detections that have none: each goes to the nearest expected person, all together."""

from __future__ import annotations

import numpy as np

from pedpred.geometry import rotate
from pedpred.tracking.matching import cheapest_pairs, distances_m
from pedpred.tracking.tracks import LOST_AFTER_S

_GATE_M, _GATE_MPS, _LARGEST_GATE_M = 0.5, 1.5, 2.0
"""Largest distance of a detection from the expected position of its person, m, plus m/s since the last one.
Expected is the last position, moved by the velocity that the last few detections give."""
_SMOOTHING_S = 0.4
_MOST_TRACKS = 2000
"""Limit of the tracks that are kept, those seen last, and of the detections that are compared with them:
detections that are noise fill neither memory nor time."""
_TRACK = np.dtype([("id", "i8"), ("seen_s", "f8"), ("position", "f8", 2), ("velocity", "f8", 2)])


class NearestTracks:
    """Identifies people by position: global nearest neighbours within a gate (Blackman & Popoli 1999)."""

    def __init__(self) -> None:
        self._next = 1
        self._tracks = np.zeros(0, _TRACK)

    def assign(self, time_s: float, position: np.ndarray) -> np.ndarray:
        """Number the people of one message; a person not seen for `LOST_AFTER_S` gets a new number.

        Args:
            time_s: of the message, s; after a jump back all are forgotten.
            position: m; those that are not finite, or too many, get numbers of their own. [D, 2]

        Returns:
            [D] int64, from 1
        """
        tracks = self._recent(time_s)
        known = np.flatnonzero(np.isfinite(position).all(axis=1))
        gap_s = np.maximum(time_s - tracks["seen_s"], 0.0)
        person, detection = _pairs(tracks, gap_s, position[known[:_MOST_TRACKS]])
        track_id = np.zeros(len(position), np.int64)
        track_id[known[detection]] = tracks["id"][person]
        _move(tracks, person, position[known[detection]], gap_s[person], time_s)
        new = np.flatnonzero(track_id == 0)
        track_id[new] = self._next + np.arange(len(new))
        self._next += len(new)
        new = np.intersect1d(new, known)
        added = np.zeros(len(new), _TRACK)
        added["id"], added["seen_s"], added["position"] = track_id[new], time_s, position[new]
        self._tracks = np.concatenate([tracks, added])
        return track_id

    def correct(self, turn_rad: float, shift: np.ndarray) -> None:
        """Move all tracks: what was at p is at p, turned about the origin, plus the shift, m. [2]."""
        turn = np.float64(turn_rad)
        self._tracks["position"] = rotate(self._tracks["position"], turn) + shift
        self._tracks["velocity"] = rotate(self._tracks["velocity"], turn)

    def _recent(self, time_s: float) -> np.ndarray:
        """The tracks that are not lost at a time, s; none after a jump back. [T] of `_TRACK`."""
        seen_s = self._tracks["seen_s"]
        if len(seen_s) and time_s < seen_s.max() - LOST_AFTER_S:
            return self._tracks[:0]
        tracks = self._tracks[time_s - seen_s <= LOST_AFTER_S]
        return tracks[np.sort(np.lexsort((tracks["id"], -tracks["seen_s"]))[:_MOST_TRACKS])]


def _pairs(tracks: np.ndarray, gap_s: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of tracks [T] and detections [D, 2] that belong together; the distances are least in sum."""
    apart = distances_m(tracks["position"] + gap_s[:, None] * tracks["velocity"], position)
    within = apart <= np.minimum(_GATE_M + _GATE_MPS * gap_s, _LARGEST_GATE_M)[:, None]
    rows, columns = np.flatnonzero(within.any(axis=1)), np.flatnonzero(within.any(axis=0))
    near = np.ix_(rows, columns)  # others have no pair, whatever it costs
    row, column = cheapest_pairs(np.where(within[near], apart[near], 2.0 * _LARGEST_GATE_M))
    person, detection = rows[row], columns[column]
    chosen = within[person, detection]
    return person[chosen], detection[chosen]


def _move(
    tracks: np.ndarray, person: np.ndarray, position: np.ndarray, gap_s: np.ndarray, time_s: float
) -> None:
    """Move tracks [n] to detections, m [n, 2], that are later."""
    later = gap_s > 0
    person, position, gap_s = person[later], position[later], gap_s[later, None]
    step = (position - tracks["position"][person]) / gap_s
    share = gap_s / (gap_s + _SMOOTHING_S)
    tracks["velocity"][person] += share * (step - tracks["velocity"][person])
    tracks["position"][person], tracks["seen_s"][person] = position, time_s
