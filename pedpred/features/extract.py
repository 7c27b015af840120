"""Extraction of the feature table of a scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np

from pedpred.features.observe import Neighbours, Observation, Pedestrians, observe
from pedpred.features.table import FeatureSettings, FeatureTable
from pedpred.features.targets import Futures, future_velocities
from pedpred.geometry import rotate
from pedpred.scenes import Scene, Trajectories
from pedpred.tracking import Tracks
from pedpred.tracking.spacing import SPACING_S, references
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_ROWS_AT_ONCE = 2**15
_MOST_CANDIDATES = 2**20


@dataclass(frozen=True)
class Steps:
    """The instants at which features are computed, sorted by (track, life, phase, step).

    Attributes:
        track_id: [Q]
        phase: [Q]
        step: [Q]
        time_s: s. [Q]
        row: the track's last detection at or before `time_s`, as a row of `Tracks`. [Q]
    """

    track_id: np.ndarray
    phase: np.ndarray
    step: np.ndarray
    time_s: np.ndarray
    row: np.ndarray

    def select(self, rows: slice) -> Steps:
        """Some of the steps."""
        return Steps(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})


def extract(
    scene: Scene, tracks: Tracks, settings: FeatureSettings, truth: Trajectories | None = None
) -> FeatureTable:
    """Compute inputs and targets of all steps of a scene; arguments of `extract_blocks`.

    Every input at time t depends on detections at or before t; only targets use later ones.
    """
    return next(extract_blocks(scene, tracks, settings, np.iinfo(np.int64).max, truth))


def extract_blocks(
    scene: Scene,
    tracks: Tracks,
    settings: FeatureSettings,
    rows: int = 8192,
    truth: Trajectories | None = None,
) -> Iterator[FeatureTable]:
    """Compute the table of `extract` in blocks of whole tracks, so that memory is bounded.

    Args:
        scene: the place and the detections.
        tracks: the tracker's states of that scene.
        settings: sizes.
        rows: largest number of rows of a block; a longer track is a block of its own. An empty scene
            gives one empty block.
        truth: true trajectories for the targets; None takes the scene's detections.
    """
    futures = _futures(scene, truth, settings)
    steps = clock_steps(tracks, scene.detection_dt_s, settings)
    around = neighbours_at(tracks, steps.time_s, scene.detection_dt_s * settings.max_age_intervals)
    for block in track_blocks(steps.track_id, rows):
        neighbours = replace(around, span=around.span[block])
        yield _features(scene, tracks, settings, steps.select(block), neighbours, futures)


def extract_at_detections(
    scene: Scene,
    tracks: Tracks,
    settings: FeatureSettings,
    truth: Trajectories | None = None,
    grids: bool = True,
) -> FeatureTable:
    """Compute the table with a row per detection instead of per step; `step` counts a life's detections.

    Forecasts are evaluated at these instants, whatever their rate; arguments of `extract`. Without `grids`,
    crops and angular grids have no columns, and rows take a fifth of the memory.
    """
    rows = np.arange(len(tracks.time_s))
    phase, step = np.zeros(len(rows), np.int8), tracks.age.astype(np.int32)
    steps = Steps(tracks.track_id, phase, step, tracks.time_s, rows)
    futures = _futures(scene, truth, settings)
    if grids:
        around = neighbours_at(tracks, steps.time_s, scene.detection_dt_s * settings.max_age_intervals)
        return _features(scene, tracks, settings, steps, around, futures)
    parts = track_blocks(steps.track_id, _ROWS_AT_ONCE)  # for smaller intermediate arrays
    return FeatureTable.join(
        [_features(scene, tracks, settings, steps.select(part), None, futures) for part in parts]
    )


def _futures(scene: Scene, truth: Trajectories | None, settings: FeatureSettings) -> Futures:
    """The true paths, known between detections that are near enough to interpolate."""
    longest_s = min(settings.truth_gap_s, settings.lost_after_s)
    return Futures.of(scene.trajectories if truth is None else truth, longest_s)


def track_blocks(track_id: np.ndarray, rows: int) -> Iterator[slice]:
    """Divide rows grouped by track into blocks of at most `rows` that do not split a track."""
    bounds = [0, *(np.flatnonzero(np.diff(track_id)) + 1).tolist(), len(track_id)]
    first = 0
    for begin, end in pairwise(bounds):
        if end - first > rows and begin > first:
            yield slice(first, begin)
            first = begin
    yield slice(first, len(track_id))


def _features(
    scene: Scene,
    tracks: Tracks,
    sizes: FeatureSettings,
    steps: Steps,
    around: Neighbours | None,
    futures: Futures,
) -> FeatureTable:
    """Inputs and targets of the steps of some whole tracks; without neighbours there are no grids."""
    walkers = pedestrians_at(tracks, steps.row, steps.time_s)
    if around is None:
        seen = Observation.without_grids(walkers)
    else:
        seen = observe(walkers, around, scene.occupancy, sizes)
    last_velocity, last_acceleration = last_differences(tracks, steps.row)
    ahead_s = (np.arange(sizes.horizon_steps) + 1) * sizes.dt_s
    path, future_steps = futures.after(tracks.person_id[steps.row], steps.time_s, ahead_s)
    future = rotate(future_velocities(walkers.position, path, sizes.dt_s), -walkers.heading_rad[:, None])
    known = np.arange(sizes.horizon_steps) < future_steps[:, None]
    return FeatureTable(
        track_id=steps.track_id,
        phase=steps.phase,
        step=steps.step,
        time_s=steps.time_s,
        position=walkers.position,
        heading_rad=walkers.heading_rad,
        velocity=seen.velocity,
        last_position=tracks.detection[steps.row],
        last_velocity=last_velocity,
        last_acceleration=last_acceleration,
        occupancy=seen.occupancy,
        angular_grid=seen.angular_grid,
        future=np.where(known[..., None], future, 0.0).astype(np.float32),
        future_steps=future_steps,
    )


def clock_steps(tracks: Tracks, detection_dt_s: float, settings: FeatureSettings) -> Steps:
    """Steps of all lives: step k of phase c is at first detection + c detection intervals + k dt_s."""
    first = np.flatnonzero(tracks.age == 0)
    names, begin = tracks.track_id[first], tracks.time_s[first]
    end = tracks.time_s[np.append(first, len(tracks.time_s))[1:] - 1]
    track = np.repeat(np.arange(len(names)), settings.phase_offsets)
    phase = np.tile(np.arange(settings.phase_offsets), len(names))
    start = begin[track] + phase * detection_dt_s
    ticks = np.floor((end[track] - start + TIME_TOLERANCE_S) / settings.dt_s).astype(np.int64) + 1
    ticks = np.maximum(ticks, 0)
    sequence = np.repeat(np.arange(len(track)), ticks)
    step = np.arange(len(sequence)) - np.repeat(np.cumsum(ticks) - ticks, ticks)
    # Round so that simultaneous steps compare equal: neighbours are grouped by instant.
    time_s = np.round((start[sequence] + step * settings.dt_s) / TIME_TOLERANCE_S) * TIME_TOLERANCE_S
    track_id = names[track[sequence]]
    row = tracks.last_row(track_id, time_s)
    return Steps(track_id, phase[sequence].astype(np.int8), step.astype(np.int32), time_s, row)


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
    return Neighbours(tracks.track_id[row], tracks.position_at(row, now[at]), tracks.velocity[row], span)


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
