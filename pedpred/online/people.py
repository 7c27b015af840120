"""The people that a robot tracks: states and the network's memory, as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from pedpred.features import Pedestrians
from pedpred.tracking import Belief, KalmanSettings, born, updated
from pedpred.tracking.tracks import TIME_TOLERANCE_S


@dataclass(frozen=True)
class People:
    """One row per person, by track. World frame.

    Attributes:
        track_id: [N] int64, rising
        born_s: time of the first detection, s. [N]
        seen_s: time of the last detection, s. [N]
        position: tracked at `seen_s`, m. [N, 2]
        velocity: tracked, m/s. [N, 2]
        covariance: of the tracker's belief. [N, 3]
        heading_rad: held while standing. [N]
        ticks: steps of the network. [N]
        memory: the network's state after them, name -> [N, ...] float32
    """

    track_id: np.ndarray
    born_s: np.ndarray
    seen_s: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    covariance: np.ndarray
    heading_rad: np.ndarray
    ticks: np.ndarray
    memory: dict[str, np.ndarray]

    def __len__(self) -> int:
        return len(self.track_id)

    @classmethod
    def nobody(cls, memory: Mapping[str, tuple[int, ...]]) -> People:
        """Nobody yet; memory: name -> shape per person."""
        none, pairs = np.zeros(0), np.zeros((0, 2))
        empty = {name: np.zeros((0, *shape), np.float32) for name, shape in memory.items()}
        whole = np.zeros(0, np.int64)
        return cls(whole, none, none, pairs, pairs, np.zeros((0, 3)), none, whole, empty)

    def select(self, rows: np.ndarray) -> People:
        """Some of them (mask or indices)."""
        kept = {f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "memory"}
        return People(**kept, memory={name: values[rows] for name, values in self.memory.items()})

    def at(self, rows: np.ndarray, time_s: float) -> Pedestrians:
        """Estimated positions of some of them at an instant."""
        position = self.position[rows] + (time_s - self.seen_s[rows])[:, None] * self.velocity[rows]
        return Pedestrians(self.track_id[rows], position, self.heading_rad[rows], self.velocity[rows])

    def together(self, others: People) -> People:
        """Both groups, by track."""
        order = np.argsort(np.concatenate([self.track_id, others.track_id]))
        joined = {
            f.name: np.concatenate([getattr(self, f.name), getattr(others, f.name)])[order]
            for f in fields(self)
            if f.name != "memory"
        }
        memory = {
            name: np.concatenate([values, others.memory[name]])[order] for name, values in self.memory.items()
        }
        return People(**joined, memory=memory)


def detected(
    people: People,
    time_s: float,
    track_id: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray | None,
    tracker: KalmanSettings,
    standstill_mps: float,
) -> People:
    """People after the detections of one instant; an unknown id is added.

    Args:
        people: before, at an earlier instant.
        time_s: s.
        track_id: unique. [D]
        position: world frame, m. [D, 2]
        velocity: true velocities, if the source has them; then nothing is filtered. [D, 2] m/s
        tracker: noise of the filter.
        standstill_mps: below this speed the heading is held.
    """
    order = np.argsort(track_id)
    track_id, position = track_id[order], position[order]
    known = np.isin(track_id, people.track_id)
    rows = np.searchsorted(people.track_id, track_id[known])
    before = Belief(people.position[rows], people.velocity[rows], people.covariance[rows])
    first = born(position[~known], tracker.position_noise_m, tracker.initial_speed_mps)
    q, r = tracker.acceleration_noise, tracker.position_noise_m
    again = updated(before, time_s - people.seen_s[rows], position[known], q, r)
    if velocity is not None:
        velocity = velocity[order]
        first = Belief(position[~known], velocity[~known], np.zeros((int((~known).sum()), 3)))
        again = Belief(position[known], velocity[known], np.zeros((len(rows), 3)))
    moved = {name: getattr(people, name).copy() for name in ("seen_s", "heading_rad", *vars(again))}
    moved["seen_s"][rows] = time_s
    moved["heading_rad"][rows] = _heading(again.velocity, people.heading_rad[rows], standstill_mps)
    for name, values in vars(again).items():
        moved[name][rows] = values
    followed = replace(people, **moved)
    if known.all():
        return followed
    return followed.together(_newborn(people, time_s, track_id[~known], first, standstill_mps))


def _newborn(
    people: People, time_s: float, track_id: np.ndarray, belief: Belief, standstill_mps: float
) -> People:
    count = len(track_id)
    now = np.full(count, time_s)
    heading = _heading(belief.velocity, np.zeros(count), standstill_mps)
    memory = {name: np.zeros((count, *v.shape[1:]), np.float32) for name, v in people.memory.items()}
    ticks = np.zeros(count, np.int64)
    position, velocity, covariance = belief.position, belief.velocity, belief.covariance
    return People(track_id, now, now.copy(), position, velocity, covariance, heading, ticks, memory)


def _heading(velocity: np.ndarray, before: np.ndarray, standstill_mps: float) -> np.ndarray:
    """Direction of motion, or the one before while standing, rad. [N]."""
    moving = np.hypot(velocity[:, 0], velocity[:, 1]) >= standstill_mps
    return np.where(moving, np.arctan2(velocity[:, 1], velocity[:, 0]), before)


def next_ticks_s(people: People, dt_s: float) -> np.ndarray:
    """Time of the next step of each person, on the grid of the offline features, s. [N]."""
    exact = people.born_s + people.ticks * dt_s
    return np.round(exact / TIME_TOLERANCE_S) * TIME_TOLERANCE_S
