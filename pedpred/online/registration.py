"""The detections of a frame: who is followed, who is new, and how each person moves afterwards.

Velocities that a source gives are compared with the way that people went: a tracker that fills in zeros, or
gives velocities relative to a robot, is believed like one that knows them, and people are then forecast to
walk backwards. Noise of positions does not add up, and steps far in the past fade, so that one false jump is
no contradiction.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pedpred.online.frame import Frame
from pedpred.online.past import Arrays, add_detection, first_seen
from pedpred.online.people import STATE, People, with_rows
from pedpred.tracking import Belief, KalmanBank
from pedpred.tracking.noise import weighted
from pedpred.tracking.tracks import jumped

_FADES_S = 3.0
"""Steps count for this time, s: somebody at 1.3 m/s who is said to stand drifts by up to 3.9 m."""
_DRIFT_M = 2.0
"""Velocities that lead farther from the positions are not those of the person, m."""


def keep_to_limit(people: People, frame: Frame, most: int) -> tuple[People, Frame]:
    """Leave people out, so that at most `most` are followed after a frame.

    People who are followed and detected stay. New ones take the room that is left, the lowest ids first, then
    those who are not detected now, the last seen first. Up to the limit, nobody is left out.

    Args:
        people: before the frame, at most `most`.
        frame: of any number of people.
        most: at least 1.
    """
    if len(people) + len(frame) <= most:
        return people, frame
    known = np.isin(frame.track_id, people.track_id, assume_unique=True)
    frame = frame.select(known | (np.cumsum(~known) <= most - known.sum()))
    seen = np.isin(people.track_id, frame.track_id, assume_unique=True)
    latest = np.lexsort((people.life, -people.seen_s, ~seen))
    return people.select(np.sort(latest[: known.sum() + most - len(frame)])), frame


def register_detections(
    people: People, frame: Frame, bank: KalmanBank, standstill_mps: float, lives: int
) -> People:
    """The people after the detections of one instant.

    An unknown id is added; one that jumps (`pedpred.tracking.tracks.jumped`) is a new person.

    Args:
        people: before, at an earlier instant.
        frame: the detections; where it has velocities, nothing is filtered.
        bank: parameters of the filters.
        standstill_mps: below this speed the heading is held.
        lives: number of the next new life.
    """
    people = _without_jumps(people, frame)
    row, known = people.rows_of(frame.track_id)
    rows = row[known] if known.sum() < len(people) else slice(None)
    followed = _follow(people, rows, frame.select(known), bank, standstill_mps)
    if known.all():
        return followed
    return followed.joined_by_track(_newborn(people, frame.select(~known), bank, standstill_mps, lives))


def contradicted(people: People) -> np.ndarray:
    """Whose given velocities are not those of the person. [N] bool."""
    return np.hypot(*people.velocity_drift.T) > _DRIFT_M


def _without_jumps(people: People, frame: Frame) -> People:
    """Those whose ids do not jump from their last detection to the one in a frame."""
    row, known = people.rows_of(frame.track_id)
    rows = row[known]
    elsewhere = jumped(people.detection[rows], frame.position[known], frame.time_s - people.seen_s[rows])
    return people.select(np.delete(np.arange(len(people)), rows[elsewhere])) if elsewhere.any() else people


def _follow(
    people: People, rows: np.ndarray | slice, frame: Frame, bank: KalmanBank, standstill_mps: float
) -> People:
    """All people after those in some rows are detected in a frame, in the same order."""
    seen, velocity, dt_s = frame.position, frame.velocity, frame.time_s - people.seen_s[rows]
    if velocity is None:
        before = Belief(*(people.filters[name][rows].reshape(-1, size) for name, size in STATE.items()))
        states = bank.follow(before, people.filters["weight"][rows], dt_s, seen, standstill_mps)
        drift = np.zeros(seen.shape)
    else:
        states = _known_states(bank, seen, velocity)
        way = 0.5 * dt_s[:, None] * (people.velocity[rows] + velocity)
        fades = np.exp(-dt_s[:, None] / _FADES_S)
        drift = fades * people.velocity_drift[rows] + (seen - people.detection[rows]) - way
    here = weighted(*states)
    heading, walked = _heading(here.velocity, people.heading_rad[rows], people.walked[rows], standstill_mps)
    moved = {
        "seen_s": frame.time_s, "detection": seen, "heading_rad": heading, "walked": walked,
        "velocity_drift": drift, **vars(here),
    }  # fmt: skip
    mine = {name: values[rows] for name, values in people.past.items()}
    past = add_detection(mine, people.seen_s[rows], people.detection[rows], frame.time_s, seen)
    changed: dict[str, Any] = {
        name: with_rows(getattr(people, name), rows, values) for name, values in moved.items()
    }
    for field, now in (("past", past), ("filters", _filter_arrays(*states))):
        held = getattr(people, field)
        changed[field] = {name: with_rows(values, rows, now[name]) for name, values in held.items()}
    return replace(people, **changed)


def _newborn(people: People, frame: Frame, bank: KalmanBank, standstill_mps: float, lives: int) -> People:
    """Those in a frame, who are detected for the first time; arrays of others say what is kept of each."""
    count, position = len(frame), frame.position
    states = bank.initial_beliefs(position), bank.unlearned(count)
    if frame.velocity is not None:
        states = _known_states(bank, position, frame.velocity)
    here, now = weighted(*states), np.full(count, frame.time_s)
    heading, walked = _heading(here.velocity, np.zeros(count), np.zeros(count, bool), standstill_mps)
    memory = {name: np.zeros((count, *v.shape[1:]), np.float32) for name, v in people.memory.items()}
    past = first_seen(count, people.past["trail_s"].shape[1])
    return People(
        track_id=frame.track_id, life=lives + np.arange(count), born_s=now, seen_s=now.copy(),
        detection=position, **vars(here), heading_rad=heading, walked=walked,
        velocity_drift=np.zeros((count, 2)), ticks=np.zeros(count, np.int64), memory=memory, past=past,
        filters=_filter_arrays(*states),
    )  # fmt: skip


def _known_states(bank: KalmanBank, position: np.ndarray, velocity: np.ndarray) -> tuple[Belief, np.ndarray]:
    """True states as all filters have them, and weights as before any detection."""
    where, going = (np.repeat(values, len(bank.filters), axis=0) for values in (position, velocity))
    return Belief(where, going, np.zeros((len(where), 3))), bank.unlearned(len(position))


def _filter_arrays(beliefs: Belief, weights: np.ndarray) -> Arrays:
    """What `People.filters` holds of beliefs, person by person, of each filter."""
    states = {name: getattr(beliefs, name).reshape(*weights.shape, size) for name, size in STATE.items()}
    return {**states, "weight": weights}


def _heading(
    velocity: np.ndarray, before: np.ndarray, walked: np.ndarray, standstill_mps: float
) -> tuple[np.ndarray, np.ndarray]:
    """Direction of motion, rad, and whether somebody ever moved; see `pedpred.tracking.follow`. [N] each."""
    moving = np.hypot(velocity[:, 0], velocity[:, 1]) >= standstill_mps
    stirs = ~walked & velocity.any(axis=1)
    return np.where(moving | stirs, np.arctan2(velocity[:, 1], velocity[:, 0]), before), walked | moving
