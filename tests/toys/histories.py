"""An input set, as somebody would add it: where a person and the nearest others were in the last seconds."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from pedpred.features.contract import StoredColumn
from pedpred.features.surroundings import Surroundings
from pedpred.geometry import rotate
from pedpred.models.mixture.features.history import PAST, past_positions
from pedpred.scenes import OccupancyMap
from pedpred.settings import In, Settings


@dataclass(frozen=True)
class ToyFeatures(Settings):
    """So many earlier positions, dt_s apart, of so many neighbours."""

    has_memory: ClassVar[bool] = False  # a row is one person at one instant

    steps: Annotated[int, In("[1, 100]")] = 4
    neighbours: Annotated[int, In("[1, 100]")] = 5

    def columns(self) -> dict[str, StoredColumn]:
        width, meaning = (self.steps + 1) * PAST, "(forward, left), m, and 1 where known; latest first"
        return {
            "velocity": StoredColumn("float32", (2,), "(forward, left), m/s"),
            "own": StoredColumn("float32", (width,), meaning),
            "others": StoredColumn("float32", (self.neighbours * width,), f"{meaning}; nearest first"),
        }

    def compute(self, seen: Surroundings, dt_s: float) -> dict[str, np.ndarray]:
        me, around = seen.observers, seen.around
        q, k, c = np.array([*self._pairs(seen)], int).reshape(-1, 3).T  # observer, rank by distance, person
        past = around.past_of(c)
        known = past.trail_s, past.trail, *np.ascontiguousarray(past.span.T), past.seen_s, past.seen
        now = seen.time_s[q], around.position[c], around.velocity[c], me.heading_rad[q]
        path = past_positions(*known, *now, self.steps, dt_s)
        apart = rotate(around.position[c] - me.position[q], -me.heading_rad[q])
        path[..., :2] += apart[:, None] * path[..., 2:]
        paths = np.zeros((len(me), 1 + self.neighbours, (self.steps + 1) * PAST), np.float32)
        paths[q, k] = path.reshape(len(path), -1)
        velocity = rotate(me.velocity, -me.heading_rad).astype(np.float32)
        return {"velocity": velocity, "own": paths[:, 0], "others": paths[:, 1:].reshape(len(me), -1)}

    def _pairs(self, seen: Surroundings):
        """Each observer with itself, 0, and its nearest neighbours, 1, 2, ..."""
        for q, (first, last) in enumerate(seen.around.span):
            away = np.linalg.norm(seen.around.position[first:last] - seen.observers.position[q], axis=-1)
            away[seen.around.track_id[first:last] == seen.observers.track_id[q]] = -1.0
            for k, c in enumerate(np.argsort(away, kind="stable")[: 1 + self.neighbours]):
                yield q, k, first + c

    def obstacle_inputs(
        self, occupancy: OccupancyMap, position: np.ndarray, heading_rad: np.ndarray
    ) -> dict[str, np.ndarray]:
        return {}  # it does not read the map

    def channels(self, stored: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        return dict(stored)

    def empty_channels(self) -> dict[str, float]:
        return {}

    def shapes(self) -> dict[str, tuple[int, ...]]:
        return {name: column.shape for name, column in self.columns().items()}

    def graph_inputs(self, stored: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        return dict(stored)

    def past_s(self, dt_s: float) -> float:
        return self.steps * dt_s
