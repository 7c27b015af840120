"""The pedestrians present at an instant, from detections up to that instant."""

from __future__ import annotations

import numpy as np

from pedpred.features.observe import Neighbours, Pedestrians
from pedpred.tracking import Tracks
from pedpred.tracking.tracks import TIME_TOLERANCE_S


def pedestrians_at(tracks: Tracks, row: np.ndarray, time_s: np.ndarray) -> Pedestrians:
    """States of some rows [Q], extrapolated to later times, s [Q]."""
    return Pedestrians(
        tracks.track_id[row], tracks.position_at(row, time_s), tracks.heading_rad[row], tracks.velocity[row]
    )


def neighbours_at(tracks: Tracks, time_s: np.ndarray, max_age_s: float) -> Neighbours:
    """Extrapolated positions of all present tracks at each observer's instant.

    A track is present while its last detection is at most `max_age_s` old; whether more will follow
    plays no part.

    Args:
        tracks: the tracker's states; those after an observer's instant are ignored for it.
        time_s: the observers' instants; equal ones must be equal to the last bit, s. [Q]
        max_age_s: s.
    """
    now, instant = np.unique(time_s, return_inverse=True)
    order = np.argsort(tracks.time_s, kind="stable")
    detected = tracks.time_s[order]
    same_next = np.append(tracks.track_id[1:] == tracks.track_id[:-1], False)
    replaced = np.where(same_next, np.append(tracks.time_s[1:], np.inf), np.inf)[order]
    low = np.searchsorted(detected, now - max_age_s, side="left")
    high = np.searchsorted(detected, now + TIME_TOLERANCE_S, side="right")
    count = high - low
    at = np.repeat(np.arange(len(now)), count)
    candidate = np.arange(len(at)) - np.repeat(np.cumsum(count) - count, count) + low[at]
    current = replaced[candidate] > now[at] + TIME_TOLERANCE_S
    row, at = order[candidate[current]], at[current]
    bounds = np.searchsorted(at, np.arange(len(now) + 1))
    span = np.stack([bounds[instant], bounds[instant + 1]], axis=-1)
    return Neighbours(tracks.track_id[row], tracks.position_at(row, now[at]), span)
