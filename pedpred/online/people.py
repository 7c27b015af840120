"""The people that a robot tracks: states, their past and the network's memory, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from pedpred.features import Pedestrians
from pedpred.online.frame import Frame
from pedpred.online.past import Arrays, first_seen, seen_again
from pedpred.online.velocities import astray_after
from pedpred.tracking import Belief, KalmanBank
from pedpred.tracking.noise import weighted
from pedpred.tracking.tracks import TIME_TOLERANCE_S, jumped

_STATE = {"position": 2, "velocity": 2, "covariance": 3}
_NAMED = ("memory", "past", "filters")


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
        astray: from where given velocities lead to the last detection, m; see `pedpred.online.velocities`.
            0 where positions are filtered. [N, 2]
        ticks: steps of the network. [N]
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
    astray: np.ndarray
    ticks: np.ndarray
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
        states = {name: np.zeros((0, filters, size)) for name, size in _STATE.items()}
        states["weight"] = np.zeros((0, filters))
        return cls(
            track_id=whole, life=whole, born_s=none, seen_s=none, detection=pairs, position=pairs,
            velocity=pairs, covariance=np.zeros((0, 3)), heading_rad=none, walked=np.zeros(0, bool),
            astray=pairs, ticks=whole, memory=empty, past=first_seen(0, slots), filters=states,
        )  # fmt: skip

    def select(self, rows: np.ndarray) -> People:
        """Some of them (mask or indices)."""
        return _array_by_array(lambda values: values[rows], self)

    def at(self, rows: np.ndarray, time_s: float) -> Pedestrians:
        """Estimated positions of some of them at an instant."""
        position = self.position[rows] + (time_s - self.seen_s[rows])[:, None] * self.velocity[rows]
        return Pedestrians(self.track_id[rows], position, self.heading_rad[rows], self.velocity[rows])

    def stepped(self, rows: np.ndarray, memory: Arrays) -> People:
        """All people after a network step for some of them, with their new memory [R, ...]."""
        whole = {name: _written(values, rows, memory[name]) for name, values in self.memory.items()}
        return replace(self, ticks=_written(self.ticks, rows, self.ticks[rows] + 1), memory=whole)

    def together(self, others: People) -> People:
        """Both groups, by track."""
        order = np.argsort(np.concatenate([self.track_id, others.track_id]))
        return _array_by_array(lambda *both: np.concatenate(both)[order], self, others)


def _array_by_array(made: Callable[..., np.ndarray], *groups: People) -> People:
    """People each of whose arrays is made from those of some groups."""
    values: dict[str, Any] = {}
    for name in (field.name for field in fields(People)):
        of_groups = [getattr(group, name) for group in groups]
        if name in _NAMED:
            values[name] = {key: made(*(arrays[key] for arrays in of_groups)) for key in of_groups[0]}
        else:
            values[name] = made(*of_groups)
    return People(**values)


def register_detections(
    people: People, frame: Frame, bank: KalmanBank, standstill_mps: float, lives: int
) -> People:
    """People after the detections of one instant.

    An unknown id is added; one that jumps (`pedpred.tracking.tracks.jumped`) is a new person.

    Args:
        people: before, at an earlier instant.
        frame: the detections; where it has velocities, nothing is filtered.
        bank: parameters of the filters.
        standstill_mps: below this speed the heading is held.
        lives: number of the next new life.
    """
    people = _without_jumps(people, frame)
    at, known = _found(people, frame.track_id)
    rows = at[known] if known.sum() < len(people) else slice(None)
    followed = _follow(people, rows, frame.select(known), bank, standstill_mps)
    if known.all():
        return followed
    return followed.together(_newborn(people, frame.select(~known), bank, standstill_mps, lives))


def _without_jumps(people: People, frame: Frame) -> People:
    """Those whose ids do not jump from their last detection to the one in a frame."""
    at, known = _found(people, frame.track_id)
    rows = at[known]
    elsewhere = jumped(people.detection[rows], frame.position[known], frame.time_s - people.seen_s[rows])
    return people.select(np.delete(np.arange(len(people)), rows[elsewhere])) if elsewhere.any() else people


def _follow(
    people: People, rows: np.ndarray | slice, frame: Frame, bank: KalmanBank, standstill_mps: float
) -> People:
    """All people after those in some rows are detected in a frame, in the same order."""
    seen, velocity, dt_s = frame.position, frame.velocity, frame.time_s - people.seen_s[rows]
    if velocity is None:
        before = Belief(*(people.filters[name][rows].reshape(-1, size) for name, size in _STATE.items()))
        states = bank.follow(before, people.filters["weight"][rows], dt_s, seen, standstill_mps)
        astray = np.zeros(seen.shape)
    else:
        states = _known_states(bank, seen, velocity)
        step, was = seen - people.detection[rows], people.velocity[rows]
        astray = astray_after(people.astray[rows], dt_s, step, was, velocity)
    here = weighted(*states)
    heading, walked = _heading(here.velocity, people.heading_rad[rows], people.walked[rows], standstill_mps)
    moved = {
        "seen_s": frame.time_s, "detection": seen, "heading_rad": heading, "walked": walked, "astray": astray,
        **vars(here),
    }  # fmt: skip
    mine = {name: values[rows] for name, values in people.past.items()}
    past = seen_again(mine, people.seen_s[rows], people.detection[rows], frame.time_s, seen)
    changed: dict[str, Any] = {
        name: _written(getattr(people, name), rows, values) for name, values in moved.items()
    }
    for field, now in (("past", past), ("filters", _kept(*states))):
        held = getattr(people, field)
        changed[field] = {name: _written(values, rows, now[name]) for name, values in held.items()}
    return replace(people, **changed)


def _known_states(bank: KalmanBank, position: np.ndarray, velocity: np.ndarray) -> tuple[Belief, np.ndarray]:
    """True states as all filters have them, and weights as before any detection."""
    where, going = (np.repeat(values, len(bank.filters), axis=0) for values in (position, velocity))
    return Belief(where, going, np.zeros((len(where), 3))), bank.unlearned(len(position))


def _kept(beliefs: Belief, weights: np.ndarray) -> Arrays:
    """What `People.filters` holds of beliefs, person by person, of each filter."""
    states = {name: getattr(beliefs, name).reshape(*weights.shape, size) for name, size in _STATE.items()}
    return {**states, "weight": weights}


def _found(people: People, track_id: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of some ids, where they are known, and whether they are. [D] each."""
    at = people.track_id.searchsorted(track_id)
    return at, people.track_id.searchsorted(track_id, side="right") > at


def _written(values: np.ndarray, rows: np.ndarray | slice, new: np.ndarray | float) -> np.ndarray:
    """An array with other values in some rows, or, of a slice, in all."""
    if isinstance(rows, slice):
        return new if isinstance(new, np.ndarray) else np.full_like(values, new)
    copy = values.copy()
    copy[rows] = new
    return copy


def _newborn(people: People, frame: Frame, bank: KalmanBank, standstill_mps: float, lives: int) -> People:
    """Those in a frame, who are detected for the first time; arrays of others say what is kept of each."""
    count, position = len(frame), frame.position
    states = bank.born(position), bank.unlearned(count)
    if frame.velocity is not None:
        states = _known_states(bank, position, frame.velocity)
    here, now = weighted(*states), np.full(count, frame.time_s)
    heading, walked = _heading(here.velocity, np.zeros(count), np.zeros(count, bool), standstill_mps)
    memory = {name: np.zeros((count, *v.shape[1:]), np.float32) for name, v in people.memory.items()}
    past = first_seen(count, people.past["trail_s"].shape[1])
    return People(
        track_id=frame.track_id, life=lives + np.arange(count), born_s=now, seen_s=now.copy(),
        detection=position, **vars(here), heading_rad=heading, walked=walked, astray=np.zeros((count, 2)),
        ticks=np.zeros(count, np.int64), memory=memory, past=past, filters=_kept(*states),
    )  # fmt: skip


def _heading(
    velocity: np.ndarray, before: np.ndarray, walked: np.ndarray, standstill_mps: float
) -> tuple[np.ndarray, np.ndarray]:
    """Direction of motion, rad, and whether somebody ever moved; see `pedpred.tracking.follow`. [N] each."""
    moving = np.hypot(velocity[:, 0], velocity[:, 1]) >= standstill_mps
    stirs = ~walked & velocity.any(axis=1)
    return np.where(moving | stirs, np.arctan2(velocity[:, 1], velocity[:, 0]), before), walked | moving


def next_ticks_s(people: People, dt_s: float) -> np.ndarray:
    """Time of the next step of each person, on the grid of the offline features, s. [N]."""
    exact = people.born_s + people.ticks * dt_s
    return np.round(exact / TIME_TOLERANCE_S) * TIME_TOLERANCE_S
