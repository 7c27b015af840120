"""What there is to see for some people at their instants: one code path, offline and online."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pedpred.arrays import real_numbers
from pedpred.errors import ValueRuleError, shape_error
from pedpred.scenes import OccupancyMap
from pedpred.tracking import Tracks
from pedpred.tracking.spacing import SPACING_S, references
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_MOST_CANDIDATES = 2**20


@dataclass(frozen=True)
class Pedestrians:
    """Tracked states, one row each. World frame.

    Attributes:
        track_id: [N] int64
        position: m. [N, 2]
        heading_rad: direction of the agent frame, counter-clockwise from world x. [N]
        velocity: m/s. [N, 2]
    """

    track_id: np.ndarray
    position: np.ndarray
    heading_rad: np.ndarray
    velocity: np.ndarray

    def __post_init__(self) -> None:
        rows = len(self.track_id)
        for field, shape in {"position": (rows, 2), "heading_rad": (rows,), "velocity": (rows, 2)}.items():
            value = real_numbers(field, getattr(self, field)).astype(np.float64, copy=False)
            if value.shape != shape:
                raise shape_error(field, value.shape, str(shape))
            if not np.isfinite(value).all():
                row = int(np.argwhere(~np.isfinite(value))[0, 0])
                raise ValueRuleError(f"{field}[{row}]", value[row].tolist(), "it must be finite")
            object.__setattr__(self, field, value)

    def __len__(self) -> int:
        return len(self.track_id)


def _unknown(rows: np.ndarray) -> Past:
    raise ValueRuleError("past_of", len(rows), "the past of these people is not known")


@dataclass(frozen=True)
class Neighbours:
    """All pedestrians, grouped by instant; each observer uses the rows of its own instant.

    Attributes:
        track_id: [C]
        position: world frame, m. [C, 2]
        velocity: world frame, m/s. [C, 2]
        span: rows [first, last) of each observer's instant. [Q, 2]
        past_of: the past of some rows [R], looked up where a model asks for it. R people
    """

    track_id: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    span: np.ndarray
    past_of: Callable[[np.ndarray], Past] = _unknown

    @classmethod
    def of_crowd(
        cls, present: Pedestrians, observers: int, past_of: Callable[[np.ndarray], Past] = _unknown
    ) -> Neighbours:
        """Everybody present at one instant, the same for all observers."""
        span = np.empty((observers, 2), np.int64)
        span[:] = 0, len(present)
        return cls(present.track_id, present.position, present.velocity, span, past_of)


@dataclass(frozen=True)
class Past:
    """What is known of the past of some people. World frame, Q people.

    Attributes:
        trail_s: detections that a history keeps (`spaced`), each person's in the order of time, s. [T]
        trail: their positions, m. [T, 2]
        span: rows [first, last) of each person's own, before the last detection. [Q, 2]
        seen_s: time of the last detection, s. [Q]
        seen: its position, m. [Q, 2]
        last_velocity: see `last_differences`; 0 after the first one, m/s. [Q, 2]
        covariance: (P_pp, P_pv, P_vv) of the tracker after the last detection. [Q, 3]
    """

    trail_s: np.ndarray
    trail: np.ndarray
    span: np.ndarray
    seen_s: np.ndarray
    seen: np.ndarray
    last_velocity: np.ndarray
    covariance: np.ndarray

    @property
    def age(self) -> np.ndarray:
        """Number of kept detections before the last one. [Q]."""
        return self.span[:, 1] - self.span[:, 0]

    @classmethod
    def of(cls, tracks: Tracks, row: np.ndarray) -> Past:
        """The past up to some rows of tracks."""
        kept = np.flatnonzero(tracks.kept())
        first, last = np.searchsorted(kept, row - tracks.age[row]), np.searchsorted(kept, row)
        velocity, _ = last_differences(tracks, row)
        return cls(
            tracks.time_s[kept],
            tracks.detection[kept],
            np.stack([first, last], axis=-1),
            tracks.time_s[row],
            tracks.detection[row],
            velocity,
            tracks.covariance[row],
        )


@dataclass(frozen=True)
class Surroundings:
    """Some people, their past, everybody around them, and the map. World frame, Q people.

    Attributes:
        observers: tracked states at the present. [Q]
        past: of the observers.
        time_s: the present of each observer, s. [Q]
        around: everybody who is present, with velocities; models leave out an observer's own track.
        occupancy: static obstacles.
    """

    observers: Pedestrians
    past: Past
    time_s: np.ndarray
    around: Neighbours
    occupancy: OccupancyMap

    @classmethod
    def of(
        cls, tracks: Tracks, row: np.ndarray, time_s: np.ndarray, around: Neighbours, occupancy: OccupancyMap
    ) -> Surroundings:
        """Collect what is around tracked people.

        Args:
            tracks: the tracker's states.
            row: last detection at or before each instant. [Q]
            time_s: the instants, s. [Q]
            around: see `neighbours_at`.
            occupancy: static obstacles.
        """
        return cls(pedestrians_at(tracks, row, time_s), Past.of(tracks, row), time_s, around, occupancy)


def last_differences(tracks: Tracks, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and acceleration from the last detections up to some rows; 0 where a track is too short.

    Differences span at least `SPACING_S`, see `pedpred.tracking.spacing`.

    World frame, m/s and m/s^2. [Q, 2] each.
    """
    reference = references(tracks.time_s, tracks.age)
    before = reference[row]
    velocity, dt_s = _difference(tracks, before, row)
    earlier, _ = _difference(tracks, reference[before], before)
    known = tracks.age[before, None] >= 1
    return velocity, np.where(known, (velocity - earlier) / dt_s, 0.0)


def _difference(tracks: Tracks, before: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Velocity between two detections, [Q, 2], and the time between them, at least `SPACING_S`, [Q, 1]."""
    dt_s = np.maximum(tracks.time_s[row] - tracks.time_s[before], SPACING_S)[:, None]
    return (tracks.detection[row] - tracks.detection[before]) / dt_s, dt_s


def pedestrians_at(tracks: Tracks, row: np.ndarray, time_s: np.ndarray) -> Pedestrians:
    """States of some rows [Q], extrapolated to later times, s [Q]."""
    return Pedestrians(
        tracks.track_id[row], tracks.position_at(row, time_s), tracks.heading_rad[row], tracks.velocity[row]
    )


def neighbours_at(tracks: Tracks, time_s: np.ndarray, max_age_s: float) -> Neighbours:
    """Extrapolated positions and velocities of all present tracks at each observer's instant.

    A track is present while its last detection is at most `max_age_s` old; whether more will follow
    plays no part.

    Args:
        tracks: the tracker's states; those after an observer's instant are ignored for it.
        time_s: the observers' instants; equal ones must be equal to the last bit, s. [Q]
        max_age_s: s.
    """
    now, instant = np.unique(time_s, return_inverse=True)
    row, at = present_rows(tracks.track_id, tracks.time_s, now, max_age_s)
    bounds = np.searchsorted(at, np.arange(len(now) + 1))
    span = np.stack([bounds[instant], bounds[instant + 1]], axis=-1)
    position, velocity = tracks.position_at(row, now[at]), tracks.velocity[row]
    return Neighbours(tracks.track_id[row], position, velocity, span, lambda some: Past.of(tracks, row[some]))


def present_rows(
    track_id: np.ndarray, time_s: np.ndarray, now_s: np.ndarray, max_age_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Find each present track's last detection at some instants.

    Args:
        track_id: rows sorted by (track, time). [M]
        time_s: of the detections, s. [M]
        now_s: the instants, rising, s. [I]
        max_age_s: a track is present while its last detection is at most this old, s.

    Returns:
        Rows and the indices of their instants, which rise. [C] each
    """
    order = np.argsort(time_s, kind="stable")
    detected = time_s[order]
    same_next = np.append(track_id[1:] == track_id[:-1], False)
    replaced = np.where(same_next, np.append(time_s[1:], np.inf), np.inf)[order]
    low = np.searchsorted(detected, now_s - max_age_s, side="left")
    high = np.searchsorted(detected, now_s + TIME_TOLERANCE_S, side="right")
    upto = np.cumsum(high - low)
    edges = np.flatnonzero(np.diff(upto // _MOST_CANDIDATES, prepend=-1, append=np.inf))  # bound the memory
    rows, instants = [np.zeros(0, order.dtype)], [np.zeros(0, np.int64)]
    for begin, end in pairwise(edges.tolist()):
        count = high[begin:end] - low[begin:end]
        at = np.repeat(np.arange(begin, end), count)
        candidate = np.arange(len(at)) - np.repeat(np.cumsum(count) - count, count) + low[at]
        current = replaced[candidate] > now_s[at] + TIME_TOLERANCE_S
        rows.append(order[candidate[current]])
        instants.append(at[current])
    return np.concatenate(rows), np.concatenate(instants)
