"""From a scene to its feature table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.features.angular import angular_grids
from pedpred.features.crop import occupancy_crops
from pedpred.features.table import FeatureSettings, FeatureTable
from pedpred.features.targets import future_velocities, true_path
from pedpred.geometry import rotate
from pedpred.scenes import Scene
from pedpred.tracking import Tracks
from pedpred.tracking.tracks import TIME_TOLERANCE_S


@dataclass(frozen=True)
class Steps:
    """The instants at which features are asked for, sorted by (track, clock, step).

    Attributes:
        track_id: [Q]
        clock: [Q]
        step: [Q]
        time_s: s. [Q]
        row: the track's last detection at or before `time_s`, as a row of `Tracks`. [Q]
    """

    track_id: np.ndarray
    clock: np.ndarray
    step: np.ndarray
    time_s: np.ndarray
    row: np.ndarray


def extract(scene: Scene, tracks: Tracks, settings: FeatureSettings) -> FeatureTable:
    """Compute inputs and targets of all steps of a scene.

    Every input at time t follows from detections at or before t; targets alone look ahead.

    Args:
        scene: the place and the annotated paths.
        tracks: the tracker's states of that scene.
        settings: sizes.
    """
    steps = clock_steps(tracks, scene.detection_dt_s, settings)
    position = tracks.position_at(steps.row, steps.time_s)
    heading = tracks.heading_rad[steps.row]
    crowd, crowd_track, span = crowds(tracks, steps, scene.detection_dt_s * settings.max_age_intervals)
    last_velocity, last_acceleration = last_differences(tracks)
    path, future_steps = _true_paths(tracks, steps, settings)
    future = rotate(future_velocities(position, path, settings.dt_s), -heading[:, None])
    known = np.arange(settings.horizon_steps) < future_steps[:, None]
    seen_now = np.abs(tracks.time_s[steps.row] - steps.time_s) <= TIME_TOLERANCE_S
    return FeatureTable(
        track_id=steps.track_id,
        clock=steps.clock,
        step=steps.step,
        time_s=steps.time_s,
        position=position,
        heading_rad=heading,
        velocity=rotate(tracks.velocity[steps.row], -heading).astype(np.float32),
        last_position=tracks.detection[steps.row],
        last_velocity=last_velocity[steps.row],
        last_acceleration=last_acceleration[steps.row],
        occupancy=occupancy_crops(
            scene.occupancy, position, heading, settings.grid_cells, settings.grid_resolution_m
        ),
        angular_grid=angular_grids(
            position,
            heading,
            crowd,
            crowd_track,
            steps.track_id,
            span,
            settings.angular_cells,
            settings.max_range_m,
        ),
        future=np.where(known[..., None], future, 0.0).astype(np.float32),
        future_steps=future_steps,
        window=seen_now & (tracks.age[steps.row] >= settings.min_history) & known.all(axis=1),
    )


def clock_steps(tracks: Tracks, detection_dt_s: float, settings: FeatureSettings) -> Steps:
    """Steps of all tracks: clock c of a track ticks at (first detection + c detections) + k dt_s."""
    names, first = np.unique(tracks.track_id, return_index=True)
    begin = tracks.time_s[first]
    end = tracks.time_s[np.append(first, len(tracks.time_s))[1:] - 1]
    track = np.repeat(np.arange(len(names)), settings.clocks)
    clock = np.tile(np.arange(settings.clocks), len(names))
    start = begin[track] + clock * detection_dt_s
    ticks = np.floor((end[track] - start + TIME_TOLERANCE_S) / settings.dt_s).astype(np.int64) + 1
    ticks = np.maximum(ticks, 0)
    sequence = np.repeat(np.arange(len(track)), ticks)
    step = np.arange(len(sequence)) - np.repeat(np.cumsum(ticks) - ticks, ticks)
    time_s = start[sequence] + step * settings.dt_s
    track_id = names[track[sequence]]
    return Steps(
        track_id,
        clock[sequence].astype(np.int8),
        step.astype(np.int32),
        time_s,
        tracks.last_row(track_id, time_s),
    )


def crowds(tracks: Tracks, steps: Steps, max_age_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where everybody is believed to be at each step's instant.

    Somebody is there while the last detection is at most `max_age_s` old. Whether there will be
    another one is not asked.

    Returns:
        Positions (world frame, m, [C, 2]) and tracks [C] grouped by instant, and for each step the
        rows [first, last) of its instant. [Q, 2]
    """
    order = np.argsort(tracks.time_s, kind="stable")
    detected = tracks.time_s[order]
    same_next = np.append(tracks.track_id[1:] == tracks.track_id[:-1], False)
    replaced = np.where(same_next, np.append(tracks.time_s[1:], np.inf), np.inf)[order]
    instants, instant = np.unique(np.round(steps.time_s / TIME_TOLERANCE_S), return_inverse=True)
    now = instants * TIME_TOLERANCE_S
    low = np.searchsorted(detected, now - max_age_s, side="left")
    high = np.searchsorted(detected, now + TIME_TOLERANCE_S, side="right")
    count = high - low
    at = np.repeat(np.arange(len(now)), count)
    candidate = np.arange(len(at)) - np.repeat(np.cumsum(count) - count, count) + low[at]
    current = replaced[candidate] > now[at] + TIME_TOLERANCE_S
    at, row = at[current], order[candidate[current]]
    bounds = np.searchsorted(at, np.arange(len(now) + 1))
    return (
        tracks.position_at(row, now[at]),
        tracks.track_id[row],
        np.stack([bounds[instant], bounds[instant + 1]], axis=-1),
    )


def last_differences(tracks: Tracks) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and acceleration of the last detections; 0 where a track is too young. [M, 2] each."""
    velocity = np.zeros_like(tracks.detection)
    acceleration = np.zeros_like(tracks.detection)
    dt_s = np.diff(tracks.time_s, prepend=0.0)[:, None]
    rows = np.flatnonzero(tracks.age >= 1)
    velocity[rows] = (tracks.detection[rows] - tracks.detection[rows - 1]) / dt_s[rows]
    rows = np.flatnonzero(tracks.age >= 2)
    acceleration[rows] = (velocity[rows] - velocity[rows - 1]) / dt_s[rows]
    return velocity, acceleration


def _true_paths(tracks: Tracks, steps: Steps, settings: FeatureSettings) -> tuple[np.ndarray, np.ndarray]:
    """True positions after each step, [Q, P, 2], and how many of them lie inside the track, [Q]."""
    ahead = (np.arange(settings.horizon_steps) + 1) * settings.dt_s
    asked = steps.time_s[:, None] + ahead
    path = np.empty((*asked.shape, 2))
    known = np.zeros(len(asked), dtype=np.int8)
    names, first = np.unique(tracks.track_id, return_index=True)
    last = np.append(first, len(tracks.track_id))[1:]
    step_first = np.searchsorted(steps.track_id, names, side="left")
    step_last = np.searchsorted(steps.track_id, names, side="right")
    for a, b, p, q in zip(first, last, step_first, step_last, strict=True):
        path[p:q] = true_path(tracks.time_s[a:b], tracks.detection[a:b], asked[p:q])
        known[p:q] = (asked[p:q] <= tracks.time_s[b - 1] + TIME_TOLERANCE_S).sum(axis=1)
    return path, known
