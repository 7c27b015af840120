"""What a network without memory reads of a person: recent motion, neighbours and obstacles, agent frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.features.contract import StoredColumn
from pedpred.features.surroundings import Surroundings
from pedpred.geometry import rotate
from pedpred.models.mixture.features.beams import obstacle_distances
from pedpred.models.mixture.features.history import PAST, past_positions
from pedpred.models.mixture.features.nearest import NEIGHBOUR, nearest_neighbours
from pedpred.scenes import OccupancyMap
from pedpred.settings import In, Settings

TRACK = 6
"""Numbers of channel "track": last velocity (m/s), the tracker's P_pp, P_pv, P_vv, and age."""
OLD = 10
"""Detections after which a track counts as old, of those that a history keeps."""


@dataclass(frozen=True)
class MixtureFeatures(Settings):
    """Sizes of the inputs.

    Attributes:
        history_steps: earlier positions, dt_s apart.
        neighbours: nearest people.
        neighbour_range_m: as far as they are seen, m.
        beams: directions in which the distance to obstacles is measured; a multiple of 4, since the network
            reads them in groups of four.
        beam_range_m: as far as obstacles are seen, m.
    """

    has_memory: ClassVar[bool] = False

    history_steps: Annotated[int, In("[1, 100]")] = 8
    neighbours: Annotated[int, In("[1, 1000]")] = 16
    neighbour_range_m: Annotated[float, In("(0, 100]")] = 8.0
    beams: Annotated[int, In("[1, 3600]")] = 96
    beam_range_m: Annotated[float, In("(0, 100]")] = 10.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.beams % 4:
            raise ValueRuleError("beams", self.beams, "it must be a multiple of 4, the size of a group")

    def columns(self) -> dict[str, StoredColumn]:
        """See `ModelFeatures`; neighbours and obstacles in half precision: to about 4 mm at 8 m."""
        past = "(forward, left), m, and 1 where known; 0, dt_s, 2 dt_s, ... before the present, row-major"
        track = "last velocity (forward, left), m/s; P_pp, P_pv, P_vv of the tracker; age"
        people = "(forward, left), m, their velocity, m/s, and weight; nearest first, row-major"
        beams = "m, distance to the nearest obstacle, counter-clockwise from the heading"
        return {
            "state": StoredColumn("float32", (2,), "tracked velocity (forward, left), m/s"),
            "history": StoredColumn("float32", ((self.history_steps + 1) * PAST,), past),
            "track": StoredColumn("float32", (TRACK,), track),
            "neighbours": StoredColumn("float16", (self.neighbours * NEIGHBOUR,), people),
            "beams": StoredColumn("float16", (self.beams,), beams),
        }

    def compute(self, seen: Surroundings, dt_s: float) -> dict[str, np.ndarray]:
        """See `ModelFeatures`; all in single precision."""
        observers, past, around = seen.observers, seen.past, seen.around
        position, heading = observers.position, observers.heading_rad
        first, last = np.ascontiguousarray(past.span.T)
        history = past_positions(
            past.trail_s, past.trail, first, last, past.seen_s, past.seen, seen.time_s,
            position, observers.velocity, heading, self.history_steps, dt_s,
        )  # fmt: skip
        nearest = nearest_neighbours(
            position, heading, around.position, around.velocity, around.track_id, observers.track_id,
            around.span, self.neighbours, self.neighbour_range_m,
        )  # fmt: skip
        age = np.minimum(past.age, OLD)[:, None] / OLD
        channels = {
            "state": rotate(observers.velocity, -heading),
            "history": history,
            "track": np.concatenate([rotate(past.last_velocity, -heading), past.covariance, age], axis=-1),
            "neighbours": nearest,
            **self.obstacle_inputs(seen.occupancy, position, heading),
        }
        shapes = self.shapes()
        return {
            name: values.reshape(len(position), *shapes[name]).astype(np.float32)
            for name, values in channels.items()
        }

    def obstacle_inputs(
        self, occupancy: OccupancyMap, position: np.ndarray, heading_rad: np.ndarray
    ) -> dict[str, np.ndarray]:
        """See `ModelFeatures`."""
        return {"beams": obstacle_distances(occupancy, position, heading_rad, self.beams, self.beam_range_m)}

    def channels(self, stored: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """See `ModelFeatures`; they are stored as the network reads them."""
        return dict(stored)

    def empty_channels(self) -> dict[str, float]:
        """See `ModelFeatures`."""
        return {"beams": self.beam_range_m}

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """See `ModelFeatures`."""
        return {name: column.shape for name, column in self.columns().items()}

    def graph_inputs(self, stored: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """See `ModelFeatures`: they are what the network reads."""
        return dict(stored)

    def past_s(self, dt_s: float) -> float:
        """See `ModelFeatures`."""
        return self.history_steps * dt_s
