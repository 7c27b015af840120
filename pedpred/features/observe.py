"""The inputs of the network for some pedestrians: one code path, offline and online."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.arrays import real_numbers
from pedpred.errors import ShapeError, ValueRuleError
from pedpred.features.grids import angular_grids, occupancy_crops
from pedpred.features.table import FeatureSettings
from pedpred.geometry import rotate
from pedpred.scenes import OccupancyMap


@dataclass(frozen=True)
class Pedestrians:
    """Tracked states, one row each. World frame.

    Attributes:
        track_id: [N] int64
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
            value = real_numbers(field, getattr(self, field)).astype(np.float64, copy=False)
            if value.shape != shape:
                raise ShapeError(field, value.shape, str(shape))
            if not np.isfinite(value).all():
                row = int(np.argwhere(~np.isfinite(value))[0, 0])
                raise ValueRuleError(f"{field}[{row}]", value[row].tolist(), "it must be finite")
            object.__setattr__(self, field, value)

    def __len__(self) -> int:
        return len(self.track_id)


@dataclass(frozen=True)
class Neighbours:
    """All pedestrians, grouped by instant; each observer uses the rows of its own instant.

    Attributes:
        track_id: [C]
        position: world frame, m. [C, 2]
        velocity: world frame, m/s. [C, 2]
        span: rows [first, last) of each observer's instant. [Q, 2]
    """

    track_id: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    span: np.ndarray

    @classmethod
    def together(cls, present: Pedestrians, observers: int) -> Neighbours:
        """Everybody present at one instant, the same for all observers."""
        span = np.empty((observers, 2), np.int64)
        span[:] = 0, len(present)
        return cls(present.track_id, present.position, present.velocity, span)


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

    @classmethod
    def without_grids(cls, observers: Pedestrians) -> Observation:
        """What needs no surroundings; the grids have no columns."""
        rows = len(observers)
        velocity = rotate(observers.velocity, -observers.heading_rad).astype(np.float32)
        return cls(velocity, np.zeros((rows, 0), np.uint8), np.zeros((rows, 0), np.float32))


def observe(
    observers: Pedestrians, neighbours: Neighbours, occupancy: OccupancyMap, settings: FeatureSettings
) -> Observation:
    """Compute the inputs of every observer; observers may belong to different instants.

    Args:
        observers: [Q]
        neighbours: the pedestrians around them; an observer's own track is left out.
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
            neighbours.position,
            neighbours.track_id,
            observers.track_id,
            neighbours.span,
            settings.angular_cells,
            settings.max_range_m,
        ),
    )
