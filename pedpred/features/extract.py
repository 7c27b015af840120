"""Extraction of the feature table of a scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np

from pedpred.features.contract import ModelFeatures
from pedpred.features.surroundings import (
    Surroundings,
    last_differences,
    neighbours_at,
    pedestrians_at,
)
from pedpred.features.table import FeatureTable, ForecastProtocol
from pedpred.features.targets import Futures, future_velocities
from pedpred.geometry import rotate
from pedpred.scenes import Scene, Trajectories
from pedpred.tracking import Tracks
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_ROWS_AT_ONCE = 2**15


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

    def __len__(self) -> int:
        return len(self.track_id)

    def select(self, rows: np.ndarray | slice) -> Steps:
        """Some of the steps."""
        return Steps(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})


def extract_blocks(
    scene: Scene,
    tracks: Tracks,
    protocol: ForecastProtocol,
    features: ModelFeatures,
    rows: int = 8192,
    truth: Trajectories | None = None,
    phase_offsets: int = 1,
) -> Iterator[FeatureTable]:
    """Compute inputs and targets of all steps of a scene, in blocks of whole tracks to bound the memory.

    Every input at time t depends on detections at or before t; only targets use later ones.

    Args:
        scene: the place and the detections.
        tracks: the tracker's states of that scene.
        protocol: time step, horizon, ages.
        features: of the model that is to read the rows.
        rows: largest number of rows of a block; a longer track is a block of its own. An empty scene
            gives one empty block.
        truth: true trajectories for the targets; None takes the scene's detections.
        phase_offsets: step sequences per track, offset by one detection interval each.
    """
    futures = Futures.of(scene.trajectories if truth is None else truth, protocol.longest_gap_s)
    steps = clock_steps(tracks, scene.detection_dt_s, protocol.dt_s, phase_offsets)
    around = neighbours_at(tracks, steps.time_s, scene.detection_dt_s * protocol.max_age_intervals)
    for block in track_blocks(steps.track_id, rows):
        instants, beside = steps.select(block), replace(around, span=around.span[block])
        seen = Surroundings.of(tracks, instants.row, instants.time_s, beside, scene.occupancy)
        computed = features.compute(seen, protocol.dt_s)
        inputs = {name: computed[name] for name in features.columns()}
        yield replace(_table(tracks, protocol, instants, futures), inputs=inputs)


def extract_at_detections(
    scene: Scene, tracks: Tracks, protocol: ForecastProtocol, truth: Trajectories | None = None
) -> FeatureTable:
    """Compute the table, without inputs, with a row per detection; `step` counts a life's detections.

    Forecasts are evaluated at these instants, whatever their rate; arguments of `extract_blocks`.
    """
    rows = np.arange(len(tracks.time_s))
    phase, step = np.zeros(len(rows), np.int8), tracks.age.astype(np.int32)
    steps = Steps(tracks.track_id, phase, step, tracks.time_s, rows)
    futures = Futures.of(scene.trajectories if truth is None else truth, protocol.longest_gap_s)
    parts = track_blocks(steps.track_id, _ROWS_AT_ONCE)  # for smaller intermediate arrays
    return FeatureTable.join([_table(tracks, protocol, steps.select(part), futures) for part in parts])


def track_blocks(track_id: np.ndarray, rows: int) -> Iterator[slice]:
    """Divide rows grouped by track into blocks of at most `rows` that do not split a track."""
    bounds = [0, *(np.flatnonzero(np.diff(track_id)) + 1).tolist(), len(track_id)]
    first = 0
    for begin, end in pairwise(bounds):
        if end - first > rows and begin > first:
            yield slice(first, begin)
            first = begin
    yield slice(first, len(track_id))


def _table(tracks: Tracks, protocol: ForecastProtocol, steps: Steps, futures: Futures) -> FeatureTable:
    """States and targets of some steps, without inputs."""
    walkers = pedestrians_at(tracks, steps.row, steps.time_s)
    last_velocity, last_acceleration = last_differences(tracks, steps.row)
    path, future_steps = futures.after(tracks.person_id[steps.row], steps.time_s, protocol.ahead_s)
    turned = -walkers.heading_rad
    future = rotate(future_velocities(walkers.position, path, protocol.dt_s), turned[:, None])
    known = np.arange(protocol.horizon_steps) < future_steps[:, None]
    return FeatureTable(
        track_id=steps.track_id,
        phase=steps.phase,
        step=steps.step,
        time_s=steps.time_s,
        position=walkers.position,
        heading_rad=walkers.heading_rad,
        velocity=rotate(walkers.velocity, turned).astype(np.float32),
        last_position=tracks.detection[steps.row],
        last_velocity=last_velocity,
        last_acceleration=last_acceleration,
        future=np.where(known[..., None], future, 0.0).astype(np.float32),
        future_steps=future_steps,
    )


def clock_steps(tracks: Tracks, detection_dt_s: float, dt_s: float, phase_offsets: int = 1) -> Steps:
    """Steps of all lives: step k of phase c is at first detection + c detection intervals + k dt_s."""
    first = np.flatnonzero(tracks.age == 0)
    names, begin = tracks.track_id[first], tracks.time_s[first]
    end = tracks.time_s[np.append(first, len(tracks.time_s))[1:] - 1]
    track = np.repeat(np.arange(len(names)), phase_offsets)
    phase = np.tile(np.arange(phase_offsets), len(names))
    start = begin[track] + phase * detection_dt_s
    ticks = np.floor((end[track] - start + TIME_TOLERANCE_S) / dt_s).astype(np.int64) + 1
    ticks = np.maximum(ticks, 0)
    sequence = np.repeat(np.arange(len(track)), ticks)
    step = np.arange(len(sequence)) - np.repeat(np.cumsum(ticks) - ticks, ticks)
    # Round so that simultaneous steps compare equal: neighbours are grouped by instant.
    time_s = np.round((start[sequence] + step * dt_s) / TIME_TOLERANCE_S) * TIME_TOLERANCE_S
    track_id = names[track[sequence]]
    row = tracks.last_row(track_id, time_s)
    return Steps(track_id, phase[sequence].astype(np.int8), step.astype(np.int32), time_s, row)
