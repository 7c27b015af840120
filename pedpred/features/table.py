"""The feature table, a row per (life, phase, step) or per detection, and the protocol it was made with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Annotated

import numpy as np

from pedpred.errors import shape_error
from pedpred.settings import In, Settings
from pedpred.tracking.tracks import LOST_AFTER_S


@dataclass(frozen=True)
class ForecastProtocol(Settings):
    """What all forecasts and their evaluation have in common, whatever a model reads.

    Attributes:
        dt_s: time between two steps, s.
        horizon_steps: forecast steps P.
        min_history: detections before the present that an evaluation window needs.
        max_age_intervals: a neighbour is dropped after this many detection intervals without detection.
        lost_after_s: an id that reappears after more than this counts as a new person, s.
        truth_gap_s: the true path is interpolated between detections at most this far apart, s.
        noncausal: the inputs use later annotations (protocol `paper`); reports must say so.
    """

    dt_s: Annotated[float, In("(0, 10000]")] = 0.3
    horizon_steps: Annotated[int, In("[1, 10000]")] = 10
    min_history: Annotated[int, In("[1, 10000]")] = 3
    max_age_intervals: Annotated[float, In("(0, 10000]")] = 1.25
    lost_after_s: Annotated[float, In("(0, 10000]")] = LOST_AFTER_S
    truth_gap_s: Annotated[float, In("(0, 10000]")] = 0.6
    noncausal: bool = False

    @property
    def ahead_s(self) -> np.ndarray:
        """Time from the present to each step of the horizon, s. [P]."""
        return (np.arange(self.horizon_steps) + 1) * self.dt_s

    @property
    def longest_gap_s(self) -> float:
        """Longest time between two detections across which the true path is interpolated, s."""
        return min(self.truth_gap_s, self.lost_after_s)


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
        future: velocities of the next P steps, agent frame, m/s; 0 where unknown. [M, P, 2] float32
        future_steps: how many of them are known: those before the life or its detections break off. [M] int8
        inputs: what a model reads there, name -> [M, ...]; see `pedpred.features.contract`.
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
    future: np.ndarray
    future_steps: np.ndarray
    inputs: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, value in {**self.columns, **self.inputs}.items():
            if len(value) != len(self.track_id):
                raise shape_error(name, value.shape, f"[{len(self.track_id)}, ...]")

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """Everything but the inputs, by name."""
        return {column.name: getattr(self, column.name) for column in fields(self) if column.name != "inputs"}

    def __len__(self) -> int:
        return len(self.track_id)

    @classmethod
    def join(cls, parts: Sequence[FeatureTable]) -> FeatureTable:
        """Join the rows of at least one part."""
        columns = {name: np.concatenate([part.columns[name] for part in parts]) for name in parts[0].columns}
        inputs = {name: np.concatenate([part.inputs[name] for part in parts]) for name in parts[0].inputs}
        return cls(**columns, inputs=inputs)

    def select(self, rows: np.ndarray) -> FeatureTable:
        """Select some rows (mask or indices)."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        return FeatureTable(**columns, inputs={name: values[rows] for name, values in self.inputs.items()})
