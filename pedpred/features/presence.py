"""Who is there at an instant, as far as the tracker knew then."""

from __future__ import annotations

import numpy as np

from pedpred.features.observe import Crowd, Pedestrians
from pedpred.tracking import Tracks
from pedpred.tracking.tracks import TIME_TOLERANCE_S


def pedestrians_at(tracks: Tracks, row: np.ndarray, time_s: np.ndarray) -> Pedestrians:
    """States of some rows, extrapolated to later times. [Q] rows, [Q] or one s."""
    return Pedestrians(
        tracks.track_id[row], tracks.position_at(row, time_s), tracks.heading_rad[row], tracks.velocity[row]
    )


def frame_at(tracks: Tracks, time_s: float, max_age_s: float) -> Pedestrians:
    """Everybody who is believed to be there at one instant, by track.

    Args:
        tracks: the tracker's states up to that instant; later ones are ignored.
        time_s: the instant, s.
        max_age_s: somebody is there while the last detection is at most this old, s.
    """
    now = np.array([time_s])
    row = np.sort(_present(tracks, now, max_age_s)[0])
    return pedestrians_at(tracks, row, now)


def crowd_at(tracks: Tracks, time_s: np.ndarray, max_age_s: float) -> Crowd:
    """Where everybody is believed to be at each observer's instant.

    Args:
        tracks: the tracker's states; later ones than an observer's instant are not seen by it.
        time_s: the observers' instants, equal ones bit by bit, s. [Q]
        max_age_s: somebody is there while the last detection is at most this old, s.
    """
    now, instant = np.unique(time_s, return_inverse=True)
    row, at = _present(tracks, now, max_age_s)
    bounds = np.searchsorted(at, np.arange(len(now) + 1))
    span = np.stack([bounds[instant], bounds[instant + 1]], axis=-1)
    return Crowd(tracks.track_id[row], tracks.position_at(row, now[at]), span)


def _present(tracks: Tracks, now: np.ndarray, max_age_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Each present track's last row at each instant, [C], and the index of that instant, [C], rising.

    Somebody is there while the last detection is at most `max_age_s` old. Whether there will be
    another one is not asked.
    """
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
    return order[candidate[current]], at[current]
