"""Targets: the true path after each step, from a spline through all annotations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.scenes import Trajectories
from pedpred.tracking.tracks import TIME_TOLERANCE_S, births, last_rows


def _true_path(time_s: np.ndarray, position: np.ndarray, query_s: np.ndarray) -> np.ndarray:
    """Interpolate the positions [A, 2] of one track at some times [...], clipped to its span. m, [..., 2]."""
    from scipy.interpolate import CubicSpline  # late: a robot has no SciPy

    query_s = np.clip(query_s, time_s[0], time_s[-1])
    if len(time_s) == 1:
        return np.broadcast_to(position[0], (*query_s.shape, 2))
    return CubicSpline(time_s, position)(query_s)


@dataclass(frozen=True)
class Futures:
    """The true paths of all pedestrians, in pieces without long gaps.

    Attributes:
        person_id: rows sorted by (person, time). [A]
        time_s: s. [A]
        position: world frame, m. [A, 2]
        first: first row of the piece of each row. [A]
        last: one past the piece's last row. [A]
    """

    person_id: np.ndarray
    time_s: np.ndarray
    position: np.ndarray
    first: np.ndarray
    last: np.ndarray

    @classmethod
    def of(cls, truth: Trajectories, longest_gap_s: float) -> Futures:
        """Split trajectories at gaps longer than `longest_gap_s` and at jumps (`births`)."""
        order = np.lexsort((truth.time_s, truth.track_id))
        person_id, time_s, position = truth.track_id[order], truth.time_s[order], truth.position[order]
        begin = np.flatnonzero(births(person_id, time_s, position, longest_gap_s))
        end = np.append(begin, len(order))[1:]
        first, last = np.repeat(begin, end - begin), np.repeat(end, end - begin)
        return cls(person_id, time_s, position, first, last)

    def after(
        self, person_id: np.ndarray, time_s: np.ndarray, ahead_s: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Look up the true positions `ahead_s` [P] after some instants.

        Args:
            person_id: detected at or before the instant. [Q]
            time_s: the instants, s. [Q]
            ahead_s: s. [P]

        Returns:
            World frame, m; the last known position beyond the end of the piece. [Q, P, 2]
            Number of steps within the piece. [Q] int8
        """
        asked = time_s[:, None] + ahead_s
        row = last_rows(self.person_id, self.time_s, person_id, time_s)
        path = np.empty((*asked.shape, 2))
        order = np.argsort(self.first[row], kind="stable")
        pieces = np.flatnonzero(np.diff(self.first[row[order]])) + 1
        for steps in np.split(order, pieces) if len(order) else []:
            a, b = self.first[row[steps[0]]], self.last[row[steps[0]]]
            path[steps] = _true_path(self.time_s[a:b], self.position[a:b], asked[steps])
        ends = self.time_s[self.last[row] - 1]
        return path, (asked <= ends[:, None] + TIME_TOLERANCE_S).sum(axis=1).astype(np.int8)


def future_velocities(position: np.ndarray, path: np.ndarray, dt_s: float) -> np.ndarray:
    """Velocities whose Euler integration from the tracked position gives the true path.

    Args:
        position: tracked position at the step, m. [M, 2]
        path: true positions at the next P steps, same frame, m. [M, P, 2]
        dt_s: time between steps, s.

    Returns:
        m/s. [M, P, 2]
    """
    before = np.concatenate([position[:, None], path[:, :-1]], axis=1)
    return (path - before) / dt_s
