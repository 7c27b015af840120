"""What pedestrians see of their surroundings: one code path, offline and online."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.errors import ShapeError, ValueRuleError
from pedpred.features.angular import angular_grids
from pedpred.features.crop import occupancy_crops
from pedpred.features.table import FeatureSettings
from pedpred.geometry import rotate
from pedpred.scenes import OccupancyMap


@dataclass(frozen=True)
class Pedestrians:
    """Tracked states, one row each. World frame.

    Attributes:
        track_id: whose. [N] int64
        position: m. [N, 2]
        heading_rad: direction of the agent frame, counter-clockwise from world x. [N]
        velocity: m/s. [N, 2]
    """

    track_id: np.ndarray
    position: np.ndarray
    heading_rad: np.ndarray
    velocity: np.ndarray

    def __post_init__(self) -> None:
        rows = len(self.track_id)
        for field, shape in {"position": (rows, 2), "heading_rad": (rows,), "velocity": (rows, 2)}.items():
            value = np.asarray(getattr(self, field), dtype=np.float64)
            if value.shape != shape:
                raise ShapeError(field, value.shape, str(shape))
            if not np.isfinite(value).all():
                row = int(np.argwhere(~np.isfinite(value))[0, 0])
                raise ValueRuleError(f"{field}[{row}]", value[row].tolist(), "it must be finite")
            object.__setattr__(self, field, value)

    def __len__(self) -> int:
        return len(self.track_id)


@dataclass(frozen=True)
class Crowd:
    """Who else is where, grouped by instant; each observer looks at the rows of its own instant.

    Attributes:
        track_id: whose position. [C]
        position: world frame, m. [C, 2]
        span: rows [first, last) that each observer looks at. [Q, 2]
    """

    track_id: np.ndarray
    position: np.ndarray
    span: np.ndarray


@dataclass(frozen=True)
class Observation:
    """The inputs of the network, one row per observer.

    Attributes:
        velocity: agent frame, m/s. [Q, 2] float32
        occupancy: bit-packed crop. [Q, cells^2 / 8] uint8
        angular_grid: distances of the nearest pedestrians, m. [Q, K] float32
    """

    velocity: np.ndarray
    occupancy: np.ndarray
    angular_grid: np.ndarray


def observe(
    observers: Pedestrians, crowd: Crowd, occupancy: OccupancyMap, settings: FeatureSettings
) -> Observation:
    """Inputs of every observer, which may stand at different instants.

    Args:
        observers: who looks. [Q]
        crowd: whom they see; nobody sees itself.
        occupancy: the static obstacles.
        settings: sizes.
    """
    position, heading = observers.position, observers.heading_rad
    return Observation(
        rotate(observers.velocity, -heading).astype(np.float32),
        occupancy_crops(occupancy, position, heading, settings.grid_cells, settings.grid_resolution_m),
        angular_grids(
            position,
            heading,
            crowd.position,
            crowd.track_id,
            observers.track_id,
            crowd.span,
            settings.angular_cells,
            settings.max_range_m,
        ),
    )


def observe_frame(frame: Pedestrians, occupancy: OccupancyMap, settings: FeatureSettings) -> Observation:
    """Inputs of everybody who is there at one instant; an empty frame gives empty arrays. [N]."""
    everybody = np.tile([0, len(frame)], (len(frame), 1))
    return observe(frame, Crowd(frame.track_id, frame.position, everybody), occupancy, settings)
