"""What a network without memory reads of a person: recent motion, neighbours and obstacles, agent frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.features.beams import obstacle_distances
from pedpred.features.extract import last_differences, neighbours_at, pedestrians_at
from pedpred.features.history import PAST, past_positions
from pedpred.features.nearest import NEIGHBOUR, nearest_neighbours
from pedpred.features.observe import Neighbours, Pedestrians
from pedpred.features.table import FeatureSettings
from pedpred.geometry import rotate
from pedpred.scenes import OccupancyMap
from pedpred.tracking import Tracks

TRACK = 6
"""Numbers of channel "track": last velocity (m/s), the tracker's P_pp, P_pv, P_vv, and age."""
OLD = 10
"""Detections after which a track counts as old, of those that a history keeps."""


@dataclass(frozen=True)
class Past:
    """What is known of the past of some people. World frame, Q people.

    Attributes:
        trail_s: detections that a history keeps (`spaced`), each person's in the order of time, s. [T]
        trail: their positions, m. [T, 2]
        span: rows [first, last) of each person's own, before the last detection. [Q, 2]
        seen_s: time of the last detection, s. [Q]
        seen: its position, m. [Q, 2]
        last_velocity: see `pedpred.features.extract.last_differences`; 0 after the first one, m/s. [Q, 2]
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


def channel_widths(sizes: FeatureSettings) -> dict[str, int]:
    """Numbers per person of each channel."""
    return {
        "state": 2,
        "history": (sizes.history_steps + 1) * PAST,
        "track": TRACK,
        "neighbours": sizes.neighbours * NEIGHBOUR,
        "beams": sizes.beams,
    }


def situations(
    observers: Pedestrians,
    past: Past,
    time_s: np.ndarray,
    around: Neighbours,
    occupancy: OccupancyMap,
    sizes: FeatureSettings,
) -> dict[str, np.ndarray]:
    """Collect the channels of some observers; one code path, offline and online.

    Args:
        observers: tracked states at the present. [Q]
        past: of the observers.
        time_s: the present of each observer, s. [Q]
        around: everybody near them, with velocities.
        occupancy: static obstacles.
        sizes: of the channels.

    Returns:
        Channel -> [Q, width] float32, see `channel_widths`.
    """
    position, heading = observers.position, observers.heading_rad
    first, last = np.ascontiguousarray(past.span.T)
    history = past_positions(
        past.trail_s, past.trail, first, last, past.seen_s, past.seen, time_s,
        position, observers.velocity, heading, sizes.history_steps, sizes.dt_s,
    )  # fmt: skip
    nearest = nearest_neighbours(
        position, heading, around.position, around.velocity, around.track_id, observers.track_id, around.span,
        sizes.neighbours, sizes.neighbour_range_m,
    )  # fmt: skip
    age = np.minimum(past.age, OLD)[:, None] / OLD
    track = np.concatenate([rotate(past.last_velocity, -heading), past.covariance, age], axis=-1)
    beams = obstacle_distances(occupancy, position, heading, sizes.beams, sizes.beam_range_m)
    found = {
        "state": rotate(observers.velocity, -heading),
        "history": history,
        "track": track,
        "neighbours": nearest,
        "beams": beams,
    }
    widths = channel_widths(sizes)
    return {
        name: values.reshape(len(position), widths[name]).astype(np.float32) for name, values in found.items()
    }


def tracked_situations(
    tracks: Tracks,
    row: np.ndarray,
    time_s: np.ndarray,
    occupancy: OccupancyMap,
    sizes: FeatureSettings,
    max_age_s: float,
) -> dict[str, np.ndarray]:
    """Collect the channels of tracked people at some instants.

    Args:
        tracks: the tracker's states.
        row: last detection at or before each instant. [Q]
        time_s: the instants; equal ones must be equal to the last bit, s. [Q]
        occupancy: static obstacles.
        sizes: of the channels.
        max_age_s: neighbours whose last detection is older are left out, s.
    """
    around = neighbours_at(tracks, time_s, max_age_s)
    return situations(
        pedestrians_at(tracks, row, time_s), Past.of(tracks, row), time_s, around, occupancy, sizes
    )
