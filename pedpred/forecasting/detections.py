"""Where people were, of which detections tell: the truth that past forecasts are compared with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.tracking.tracks import TIME_TOLERANCE_S, last_rows

GAP_S = 1.0
"""Positions are known between detections that are at most so far apart, s."""
NEAR_S, _MANY = 0.2, 3
"""A line is fitted to the detections this near in time, s, if there are so many."""


@dataclass(frozen=True)
class Detections:
    """Where people were at some instants, world frame: time_s [M], track_id [M], position, m [M, 2]."""

    time_s: np.ndarray
    track_id: np.ndarray
    position: np.ndarray

    @classmethod
    def join(cls, parts: tuple[Detections, ...]) -> Detections:
        """All of them, sorted by track and time; instants rise from part to part."""
        time_s, track_id, position = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("time_s", "track_id", "position")
        )
        order = np.argsort(track_id, kind="stable")
        return cls(time_s[order], track_id[order], position[order])

    def at(self, track_id: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions of some tracks, and their noise.

        The value of a line through the detections within 0.2 s, if there are three or more: it is less noisy
        than one of them. Else interpolated.

        Returns:
            Positions, NaN between detections too far apart [Q, 2]; their variance in units of a detection's
            [Q].
        """
        earlier_s, later_s = time_s - NEAR_S - 2 * TIME_TOLERANCE_S, time_s + NEAR_S
        asked_s = np.concatenate([time_s, earlier_s, later_s])
        before, first, end = last_rows(self.track_id, self.time_s, np.tile(track_id, 3), asked_s).reshape(
            3, -1
        )
        after = np.minimum(before + 1, len(self.time_s) - 1)
        exact = np.abs(self.time_s[before] - time_s) <= TIME_TOLERANCE_S
        after = np.where(exact, before, after)
        span_s = self.time_s[after] - self.time_s[before]
        near = (self.track_id[after] == track_id) & (after > before) & (span_s <= GAP_S + TIME_TOLERANCE_S)
        known = (before >= 0) & (exact | near)
        part = np.where(exact, 0.0, (time_s - self.time_s[before]) / np.where(span_s > 0, span_s, 1.0))
        found = self.position[before] + part[:, None] * (self.position[after] - self.position[before])
        noise = (1.0 - part) ** 2 + part**2
        first, end = np.maximum(first + 1, np.searchsorted(self.track_id, track_id)), end + 1
        many = end - first >= _MANY
        if many.any():
            found[many], noise[many] = self._on_line(first[many], end[many], time_s[many])
        return np.where(known[:, None], found, np.nan), noise

    def _on_line(
        self, first: np.ndarray, end: np.ndarray, time_s: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Values at some times of lines that are fitted to the rows from first to before end; see `at`."""
        since_s, offset = (self.time_s - self.time_s[0])[:, None], self.position - self.position[0]
        terms = np.concatenate([since_s, since_s**2, offset, since_s * offset], axis=1)
        sums = np.concatenate([np.zeros((1, terms.shape[1])), np.cumsum(terms, axis=0)])
        count = (end - first)[:, None]
        t, tt, p, tp = np.split((sums[end] - sums[first]) / count, [1, 2, 4], axis=1)
        spread, off_s = tt - t * t, time_s[:, None] - self.time_s[0] - t
        value = self.position[0] + p + (tp - t * p) / spread * off_s
        return value, ((1.0 + off_s**2 / spread) / count)[:, 0]
