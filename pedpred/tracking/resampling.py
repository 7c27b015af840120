"""The usual, noncausal preparation of annotated tracks (protocol `paper`); for comparison only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pedpred.scenes import Scene, Trajectories
from pedpred.tracking.tracks import LOST_AFTER_S, TIME_TOLERANCE_S, births


def resampled(scene: Scene, dt_s: float, lost_after_s: float = LOST_AFTER_S) -> Scene:
    """Positions and velocities every `dt_s` from cubic splines through each whole track.

    The velocities at the annotations are central differences, as in the velocity columns of the ETH files,
        v(t_k) = (p(t_{k+1}) - p(t_{k-1})) / (t_{k+1} - t_{k-1})
    (weighted where the spacing changes, one-sided at the ends of a track). Both leak the future: v contains
    the next annotation, and the splines depend on all later ones. Tracks of one annotation are dropped.

    Args:
        scene: annotated at any rate.
        dt_s: time between the new states, s.
        lost_after_s: an id that reappears after a longer gap, or jumps, counts as a new person, s.
    """
    from scipy.interpolate import CubicSpline  # late: a robot has no SciPy

    trajectories = scene.trajectories
    order = np.lexsort((trajectories.time_s, trajectories.track_id))
    track_id, time_s, position = (
        values[order] for values in (trajectories.track_id, trajectories.time_s, trajectories.position)
    )
    first = np.flatnonzero(births(track_id, time_s, position, lost_after_s))
    parts: list[tuple[np.ndarray, ...]] = []
    for a, b in zip(first, np.append(first, len(track_id))[1:], strict=True):
        ticks = int((time_s[b - 1] - time_s[a] + TIME_TOLERANCE_S) / dt_s) + 1
        if ticks > 1:
            now = time_s[a] + np.arange(ticks) * dt_s
            velocity = np.gradient(position[a:b], time_s[a:b], axis=0)
            path, pace = (CubicSpline(time_s[a:b], values)(now) for values in (position[a:b], velocity))
            parts.append((now, np.full(ticks, track_id[a]), path, pace))
    empty = (np.zeros(0), np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2)))
    columns = [np.concatenate(column) for column in zip(empty, *parts, strict=True)]
    return replace(scene, trajectories=Trajectories(*columns), detection_dt_s=dt_s)
