"""The feature table, a row per (life, phase, step) or per detection, and the sizes it was made with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from pedpred.errors import ShapeError, ValueRuleError
from pedpred.tracking.tracks import LOST_AFTER_S

_LARGEST_SETTING = 10_000


@dataclass(frozen=True)
class FeatureSettings:
    """Sizes of the inputs and of the forecast; the defaults are the paper's.

    Attributes:
        dt_s: time between two steps, s.
        horizon_steps: forecast steps P.
        min_history: detections before the present that an evaluation window needs.
        phase_offsets: step sequences per track that training reads, offset by one detection interval each.
        grid_cells: cells per side of the occupancy crop.
        grid_resolution_m: side of a crop cell, m.
        angular_cells: cones K of the angular pedestrian grid.
        max_range_m: range of that grid, m.
        history_steps: earlier positions that a network without memory reads, dt_s apart.
        neighbours: nearest people that it reads.
        neighbour_range_m: as far as it sees them, m.
        beams: directions in which it measures the distance to obstacles; a multiple of 4.
        beam_range_m: as far as it sees them, m.
        max_age_intervals: a neighbour is dropped after this many detection intervals without detection.
        lost_after_s: an id that reappears after more than this counts as a new person, s.
        truth_gap_s: the true path is interpolated between detections at most this far apart, s.
        noncausal: the inputs use later annotations (protocol `paper`); reports must say so.
    """

    dt_s: float = 0.3
    horizon_steps: int = 10
    min_history: int = 3
    phase_offsets: int = 1
    grid_cells: int = 60
    grid_resolution_m: float = 0.1
    angular_cells: int = 72
    max_range_m: float = 6.0
    history_steps: int = 8
    neighbours: int = 16
    neighbour_range_m: float = 8.0
    beams: int = 96
    beam_range_m: float = 10.0
    max_age_intervals: float = 1.25
    lost_after_s: float = LOST_AFTER_S
    truth_gap_s: float = 0.6
    noncausal: bool = False

    def __post_init__(self) -> None:
        for field in fields(self):
            value, kind = getattr(self, field.name), field.type
            number = isinstance(value, int if kind == "int" else int | float) and not isinstance(value, bool)
            if kind == "bool" and not isinstance(value, bool):
                raise ValueRuleError(field.name, value, "it must be true or false")
            if kind != "bool" and not (number and 0 < value < _LARGEST_SETTING):
                raise ValueRuleError(
                    field.name, value, f"it must be a positive {kind} below {_LARGEST_SETTING}"
                )
        for name in ("grid_cells", "beams"):  # crops are stored in whole bytes, beams turned by quarters
            if getattr(self, name) % 4:
                raise ValueRuleError(name, getattr(self, name), "it must be a multiple of 4")


@dataclass(frozen=True)
class FeatureTable:
    """Inputs and targets of one scene, sorted by (track, phase, step). World frame unless stated.

    Attributes:
        track_id: [M] int64
        phase: index of the offset step sequence. [M] int8
        step: counted from the first step of (life, phase); a life is one stay of one id. In a table at
            detections: earlier detections of the life. [M] int32
        time_s: of the step, s. [M] float64
        position: tracked, m. [M, 2] float64
        heading_rad: of the agent frame. [M] float64
        velocity: tracked, agent frame, m/s. [M, 2] float32
        last_position: the last detection, m. [M, 2] float64
        last_velocity: difference of the last two detections, m/s. [M, 2] float64
        last_acceleration: difference of the last two such velocities, m/s^2. [M, 2] float64
        occupancy: bit-packed crop. [M, cells^2 / 8] uint8
        angular_grid: distances of the nearest pedestrians, m. [M, K] float32
        future: velocities of the next P steps, agent frame, m/s; 0 where unknown. [M, P, 2] float32
        future_steps: how many of them are known: those before the life or its detections break off. [M] int8
    """

    track_id: np.ndarray
    phase: np.ndarray
    step: np.ndarray
    time_s: np.ndarray
    position: np.ndarray
    heading_rad: np.ndarray
    velocity: np.ndarray
    last_position: np.ndarray
    last_velocity: np.ndarray
    last_acceleration: np.ndarray
    occupancy: np.ndarray
    angular_grid: np.ndarray
    future: np.ndarray
    future_steps: np.ndarray

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if len(value) != len(self.track_id):
                raise ShapeError(field.name, value.shape, f"[{len(self.track_id)}, ...]")

    def __len__(self) -> int:
        return len(self.track_id)

    @classmethod
    def join(cls, parts: Sequence[FeatureTable]) -> FeatureTable:
        """Join the rows of at least one part."""
        return cls(**{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)})

    def select(self, rows: np.ndarray) -> FeatureTable:
        """Select some rows (mask or indices)."""
        return FeatureTable(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})
