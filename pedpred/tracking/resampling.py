"""The usual preparation of annotated tracks, which knows the future; for comparison only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from pedpred.scenes import Recording, Scene
from pedpred.tracking.tracks import TIME_TOLERANCE_S, births


def resampled(scene: Scene, dt_s: float, lost_after_s: float = 2.0) -> Scene:
    """Positions every `dt_s` from a cubic spline through each whole track, velocities as central differences.

    Both leak: the spline bends towards annotations that are still to come, and
        v(t) = (p(t + dt_s) - p(t - dt_s)) / (2 dt_s)
    contains the next step itself. Ends of a track use one-sided differences. Tracks of one annotation vanish.

    Args:
        scene: annotated at any rate.
        dt_s: time between the new states, s.
        lost_after_s: an id that was silent for longer is somebody new, s.
    """
    recording = scene.recording
    order = np.lexsort((recording.time_s, recording.track_id))
    track_id, time_s, position = (
        values[order] for values in (recording.track_id, recording.time_s, recording.position)
    )
    first = np.flatnonzero(births(track_id, time_s, lost_after_s))
    parts: list[tuple[np.ndarray, ...]] = []
    for a, b in zip(first, np.append(first[1:], len(track_id)), strict=True):
        ticks = int((time_s[b - 1] - time_s[a] + TIME_TOLERANCE_S) / dt_s) + 1
        if b - a > 1 and ticks > 1:
            now = time_s[a] + np.arange(ticks) * dt_s
            path = CubicSpline(time_s[a:b], position[a:b])(now)
            parts.append((now, np.full(ticks, track_id[a]), path, np.gradient(path, dt_s, axis=0)))
    empty = (np.zeros(0), np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2)))
    columns = [np.concatenate(column) for column in zip(empty, *parts, strict=True)]
    return replace(scene, recording=Recording(*columns), detection_dt_s=dt_s)
