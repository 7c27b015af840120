"""Tracked states of every pedestrian after every detection, and their extrapolation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import Trajectories
from pedpred.tracking.kalman import Belief, KalmanSettings, correct, initial_belief, predict
from pedpred.tracking.noise import KalmanBank, weighted
from pedpred.tracking.spacing import TIME_TOLERANCE_S, spaced

LOST_AFTER_S = 2.0
"""Longest gap within a track by default, s."""

FASTEST_MPS, JUMP_M = 10.0, 1.0
"""Nobody moves farther between two detections than at this speed, m/s, and by this error of detections, m."""

_CONVERGED = 200
"""Detections after which the covariance of the filter no longer changes."""


@dataclass(frozen=True)
class Tracks:
    """The tracker's state after each detection, sorted by (track, time). Row k depends on rows <= k only.

    An id that reappears after a long gap or impossibly far away counts as a new person: a life is one stay
    of one id.

    Attributes:
        track_id: [M]
        person_id: the person really detected; differs from track_id where a sensor swaps ids. [M]
        life: index of the stay, over all tracks. [M]
        time_s: of the detection, s. [M]
        age: number of earlier detections of the same life. [M]
        detection: measured position, world frame, m. [M, 2]
        position: tracked, world frame, m. [M, 2]
        velocity: tracked, world frame, m/s. [M, 2]
        covariance: (P_pp, P_pv, P_vv) of each axis, see `Belief`; 0 for true states. [M, 3]
        heading_rad: direction of the velocity; held while standing. [M]
    """

    track_id: np.ndarray
    person_id: np.ndarray
    life: np.ndarray
    time_s: np.ndarray
    age: np.ndarray
    detection: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    covariance: np.ndarray
    heading_rad: np.ndarray

    def kept(self) -> np.ndarray:
        """Which detections a history keeps, see `pedpred.tracking.spacing`. [M] bool."""
        return spaced(self.time_s, self.age)

    def kept_before(self, row: np.ndarray) -> np.ndarray:
        """How many earlier detections of the same life a history keeps. [Q]."""
        count = np.cumsum(self.kept())
        return np.where(self.age[row] > 0, count[row - 1] - count[row - self.age[row]] + 1, 0)

    def last_row(self, track_id: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Row of each track's last detection at or before a time; -1 when there is none. [Q]."""
        return last_rows(self.track_id, self.time_s, track_id, time_s)

    def position_at(self, row: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Position extrapolated from a row to a later time, world frame, m. [Q, 2]."""
        return self.position[row] + (time_s - self.time_s[row])[:, None] * self.velocity[row]

    def belief_at(self, row: np.ndarray, time_s: np.ndarray, acceleration_noise: float) -> Belief:
        """State and covariance extrapolated from a row to a later time.

        Args:
            row: of the last detection before that time. [Q]
            time_s: s. [Q]
            acceleration_noise: spectral density q of the filter, m^2/s^3.
        """
        belief = Belief(self.position[row], self.velocity[row], self.covariance[row])
        return predict(belief, time_s - self.time_s[row], acceleration_noise)


def last_rows(
    track_id: np.ndarray, time_s: np.ndarray, asked_id: np.ndarray, asked_s: np.ndarray
) -> np.ndarray:
    """Last row of each queried track at or before a time; -1 when there is none. [Q].

    Args:
        track_id: rows sorted by (track, time). [M]
        time_s: of those rows, s. [M]
        asked_id: queried track. [Q]
        asked_s: queried time, s. [Q]
    """
    if not len(track_id):
        return np.full(len(asked_id), -1)
    span, start = float(np.ptp(time_s)) + 1.0, time_s.min()
    names, index = np.unique(track_id, return_inverse=True)
    keys = index * 2 * span + (time_s - start)
    asked = np.searchsorted(names, asked_id)
    elapsed = np.clip(asked_s - start + TIME_TOLERANCE_S, -0.5, span)
    row = np.searchsorted(keys, asked * 2 * span + elapsed, side="right") - 1
    known = (row >= 0) & (track_id[np.maximum(row, 0)] == asked_id)
    return np.where(known, row, -1)


def births(track_id: np.ndarray, time_s: np.ndarray, position: np.ndarray, lost_after_s: float) -> np.ndarray:
    """Rows where a life begins: a new id, a gap longer than `lost_after_s`, or a jump. [M] bool.

    Args:
        track_id: rows sorted by (track, time). [M]
        time_s: of those rows, s. [M]
        position: detected there, m. [M, 2]
        lost_after_s: longest gap within a life, s.
    """
    born = np.diff(track_id, prepend=track_id[:1] - 1) != 0
    gap_s = np.diff(time_s)
    born[1:] |= (gap_s > lost_after_s + TIME_TOLERANCE_S) | jumped(position[:-1], position[1:], gap_s)
    return born


def jumped(before: np.ndarray, after: np.ndarray, gap_s: np.ndarray) -> np.ndarray:
    """Which detections are too far from the last one of the same id to be the same person. [N] bool.

    Args:
        before: the last detections, m. [N, 2]
        after: the next ones, m. [N, 2]
        gap_s: time between both, s. [N]
    """
    away_m = np.hypot(*(after - before).T)
    return away_m > JUMP_M + FASTEST_MPS * gap_s


def follow(
    trajectories: Trajectories,
    kind: str,
    kalman: KalmanSettings | KalmanBank | None,
    standstill_mps: float,
    lost_after_s: float = LOST_AFTER_S,
) -> Tracks:
    """Track all pedestrians causally. Time stamps may be irregular, tracks may have gaps.

    Args:
        trajectories: detections.
        kind: "kalman" filters the positions; "truth" takes the true states of a simulation.
        kalman: the filter's parameters, for kind "kalman", or several filters that are weighted.
        standstill_mps: below this speed the heading is held, m/s.
        lost_after_s: an id that reappears after a longer gap starts a new life, s; one that jumps does, too.

    Raises:
        ValueRuleError: an unknown kind, or "truth" for trajectories without velocities.
    """
    order = np.lexsort((trajectories.time_s, trajectories.track_id))
    track_id, time_s = trajectories.track_id[order], trajectories.time_s[order]
    person_id = track_id if trajectories.person_id is None else trajectories.person_id[order]
    detection = trajectories.position[order]
    born_here = births(track_id, time_s, detection, lost_after_s)
    first = np.flatnonzero(born_here)
    age = np.arange(len(track_id)) - np.repeat(first, np.diff(first, append=len(track_id)))
    if kind == "kalman" and kalman is not None:
        bank = kalman if isinstance(kalman, KalmanBank) else KalmanBank((kalman,))
        state = _filtered_by(bank, time_s, detection, age, standstill_mps)
    elif kind == "truth" and trajectories.velocity is not None:
        state = Belief(detection, trajectories.velocity[order], np.zeros((len(detection), 3)))
    else:
        raise ValueRuleError("kind", kind, "it must be 'kalman', or 'truth' where velocities are known")
    return Tracks(
        track_id,
        person_id,
        np.cumsum(born_here) - 1,
        time_s,
        age,
        detection,
        state.position,
        state.velocity,
        state.covariance,
        _held_heading(state.velocity, age, standstill_mps),
    )


def _filtered_by(
    bank: KalmanBank, time_s: np.ndarray, detection: np.ndarray, age: np.ndarray, standstill_mps: float
) -> Belief:
    """Filter all lives in parallel with each filter of a bank; their weighted states. [M]."""
    if len(bank.filters) == 1:
        return _filtered(time_s, detection, age, bank.filters[0])
    state = Belief(np.empty_like(detection), np.empty_like(detection), np.empty((len(detection), 3)))
    beliefs, weights, rows = bank.initial_beliefs(detection[:0]), bank.unlearned(0), np.zeros(0, int)
    for k in range(int(age.max(initial=-1)) + 1):
        before, rows = rows, np.flatnonzero(age == k)
        if k == 0:
            beliefs, weights = bank.initial_beliefs(detection[rows]), bank.unlearned(len(rows))
        else:
            goes_on = np.isin(before, rows - 1, assume_unique=True)
            beliefs = Belief(
                *(part[np.repeat(goes_on, len(bank.filters))] for part in vars(beliefs).values())
            )
            dt_s = time_s[rows] - time_s[rows - 1]
            beliefs, weights = bank.follow(beliefs, weights[goes_on], dt_s, detection[rows], standstill_mps)
        for name, values in vars(state).items():
            values[rows] = getattr(weighted(beliefs, weights), name)
    return state


def _filtered(time_s: np.ndarray, detection: np.ndarray, age: np.ndarray, settings: KalmanSettings) -> Belief:
    """Filter all lives in parallel, one detection of each per iteration. [M]."""
    state = Belief(np.empty_like(detection), np.empty_like(detection), np.empty((len(detection), 3)))
    for k in range(int(age.max(initial=-1)) + 1):
        rows = np.flatnonzero(age == k)
        if k == 0:
            belief = initial_belief(detection[rows], settings.position_noise_m, settings.initial_speed_mps)
        else:
            before = Belief(*(values[rows - 1] for values in vars(state).values()))
            dt_s = time_s[rows] - time_s[rows - 1]
            ahead = predict(before, dt_s, settings.acceleration_noise)
            belief = correct(ahead, dt_s, detection[rows], settings.position_noise_m)
        for name, values in vars(state).items():
            values[rows] = getattr(belief, name)
    return state


def steady_state(interval_s: float, settings: KalmanSettings) -> Belief:
    """Steady-state belief of the filter under regular detections. N = 1.

    Args:
        interval_s: time between two detections, s.
        settings: noise parameters.
    """
    here, dt_s = np.zeros((1, 2)), np.array([interval_s])
    belief = initial_belief(here, settings.position_noise_m, settings.initial_speed_mps)
    for _ in range(_CONVERGED):
        ahead = predict(belief, dt_s, settings.acceleration_noise)
        belief = correct(ahead, dt_s, here, settings.position_noise_m)
    return belief


def _held_heading(velocity: np.ndarray, age: np.ndarray, standstill_mps: float) -> np.ndarray:
    """Direction of motion; while standing, the last one of the same life. [M] rad.

    Before the first motion, the direction of the latest velocity, however small, so that the heading turns
    with the world; world x where there is none yet.
    """
    rows = np.arange(len(velocity))
    moving = np.hypot(velocity[:, 0], velocity[:, 1]) >= standstill_mps
    latest, stirred = (
        np.maximum.accumulate(np.where(some, rows, -1)) for some in (moving, velocity.any(axis=1))
    )
    born = rows - age
    latest = np.where(latest >= born, latest, stirred)  # a motion before belongs to another life
    source = velocity[np.maximum(latest, 0)]
    return np.where(latest >= born, np.arctan2(source[:, 1], source[:, 0]), 0.0)
