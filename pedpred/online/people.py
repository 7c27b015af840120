"""The people that a robot tracks: states, their past and the network's memory, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from pedpred.features import Pedestrians
from pedpred.online.past import Arrays, first_seen
from pedpred.tracking.tracks import TIME_TOLERANCE_S

STATE = {"position": 2, "velocity": 2, "covariance": 3}
"""Sizes of the parts of a filter's belief."""
_DICTIONARIES = ("memory", "past", "filters")


@dataclass(frozen=True)
class People:
    """One row per person, by track. World frame.

    Attributes:
        track_id: [N] int64, rising
        life: number of the stay of this id, counted over all people since the last reset. [N] int64
        born_s: time of the first detection, s. [N]
        seen_s: time of the last detection, s. [N]
        detection: the last one, m. [N, 2]
        position: tracked at `seen_s`, m. [N, 2]
        velocity: tracked, m/s. [N, 2]
        covariance: of the tracker's belief. [N, 3]
        heading_rad: held while standing. [N]
        walked: whether they ever moved; until then the heading follows the slightest motion. [N] bool
        velocity_drift: from where given velocities lead to the last detection, m; 0 where positions are
            filtered. See `pedpred.online.registration`. [N, 2]
        steps: of the network so far. [N]
        memory: the network's state after them, name -> [N, ...] float32
        past: recent detections, see `pedpred.online.past`.
        filters: beliefs of all filters at `seen_s` (position, velocity, covariance: [N, H, 2 or 3] each) and
            their log weights (weight: [N, H]).
    """

    track_id: np.ndarray
    life: np.ndarray
    born_s: np.ndarray
    seen_s: np.ndarray
    detection: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    covariance: np.ndarray
    heading_rad: np.ndarray
    walked: np.ndarray
    velocity_drift: np.ndarray
    steps: np.ndarray
    memory: Arrays
    past: Arrays
    filters: Arrays

    def __len__(self) -> int:
        return len(self.track_id)

    @classmethod
    def nobody(cls, memory: Mapping[str, tuple[int, ...]], slots: int, filters: int = 1) -> People:
        """Nobody yet; memory: name -> shape per person; slots: detections that their past holds."""
        none, pairs, whole = np.zeros(0), np.zeros((0, 2)), np.zeros(0, np.int64)
        empty = {name: np.zeros((0, *shape), np.float32) for name, shape in memory.items()}
        states = {name: np.zeros((0, filters, size)) for name, size in STATE.items()}
        states["weight"] = np.zeros((0, filters))
        return cls(
            track_id=whole, life=whole, born_s=none, seen_s=none, detection=pairs, position=pairs,
            velocity=pairs, covariance=np.zeros((0, 3)), heading_rad=none, walked=np.zeros(0, bool),
            velocity_drift=pairs, steps=whole, memory=empty, past=first_seen(0, slots), filters=states,
        )  # fmt: skip

    def rows_of(self, track_id: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows of some ids, where they are known, and whether they are. [D] each."""
        row = self.track_id.searchsorted(track_id)
        return row, self.track_id.searchsorted(track_id, side="right") > row

    def select(self, rows: np.ndarray) -> People:
        """Some of them (mask or indices)."""
        return _array_by_array(lambda values: values[rows], self)

    def at(self, rows: np.ndarray, time_s: float) -> Pedestrians:
        """Estimated positions of some of them at an instant."""
        position = self.position[rows] + (time_s - self.seen_s[rows])[:, None] * self.velocity[rows]
        return Pedestrians(self.track_id[rows], position, self.heading_rad[rows], self.velocity[rows])

    def stepped(self, rows: np.ndarray, memory: Arrays) -> People:
        """All people after a network step for some of them, with their new memory [R, ...]."""
        whole = {name: with_rows(values, rows, memory[name]) for name, values in self.memory.items()}
        return replace(self, steps=with_rows(self.steps, rows, self.steps[rows] + 1), memory=whole)

    def joined_by_track(self, others: People) -> People:
        """These people and others, sorted by track."""
        order = np.argsort(np.concatenate([self.track_id, others.track_id]))
        return _array_by_array(lambda *both: np.concatenate(both)[order], self, others)


def _array_by_array(made: Callable[..., np.ndarray], *groups: People) -> People:
    """People each of whose arrays is made from those of some groups."""
    values: dict[str, Any] = {}
    for name in (field.name for field in fields(People)):
        of_groups = [getattr(group, name) for group in groups]
        if name in _DICTIONARIES:
            values[name] = {key: made(*(arrays[key] for arrays in of_groups)) for key in of_groups[0]}
        else:
            values[name] = made(*of_groups)
    return People(**values)


def with_rows(values: np.ndarray, rows: np.ndarray | slice, new: np.ndarray | float) -> np.ndarray:
    """An array with other values in some rows, or, of a slice, in all."""
    if isinstance(rows, slice):
        return new if isinstance(new, np.ndarray) else np.full_like(values, new)
    copy = values.copy()
    copy[rows] = new
    return copy


def next_steps_s(people: People, dt_s: float) -> np.ndarray:
    """Time of the next step of each person, on the grid of the offline features, s. [N]."""
    exact = people.born_s + people.steps * dt_s
    return np.round(exact / TIME_TOLERANCE_S) * TIME_TOLERANCE_S
