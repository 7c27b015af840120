"""What the paper's network reads of a person: velocity, occupancy crop, angular pedestrian grid (III-B)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.features.contract import StoredColumn
from pedpred.features.surroundings import Surroundings
from pedpred.geometry import rotate
from pedpred.models.lstm.features.grids import angular_grids, occupancy_crops, unpack_crops
from pedpred.scenes import OccupancyMap
from pedpred.settings import In, Settings


@dataclass(frozen=True)
class LstmFeatures(Settings):
    """Sizes of the grids; the defaults are the paper's.

    Names of the two grids: the stored "occupancy" (bits) is the input "crop" of the graph (cells), and the
    encoder's embedding of it is the channel "grid"; the stored "angular_grid" (m) becomes the channel
    "angular" (1 - r / r_max).

    Attributes:
        grid_cells: cells per side of the occupancy crop.
        grid_resolution_m: side of a crop cell, m.
        angular_cells: cones K of the angular pedestrian grid.
        max_range_m: range of that grid, m.
    """

    has_memory: ClassVar[bool] = True

    grid_cells: Annotated[int, In("[1, 1000]")] = 60
    grid_resolution_m: Annotated[float, In("[0.001, 10]")] = 0.1
    angular_cells: Annotated[int, In("[1, 3600]")] = 72
    max_range_m: Annotated[float, In("(0, 100]")] = 6.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.grid_cells % 4:
            rule = "it must be a multiple of 4: crops are stored in whole bytes"
            raise ValueRuleError("grid_cells", self.grid_cells, rule)

    def columns(self) -> dict[str, StoredColumn]:
        """See `ModelFeatures`."""
        bits = "bits, cell (i forward, j left) is bit i * grid_cells + j, least significant first"
        cones = "m, cone k covers [k, k+1) * 2 pi / angular_cells counter-clockwise from the heading"
        return {
            "state": StoredColumn("float32", (2,), "tracked velocity (forward, left), m/s"),
            "occupancy": StoredColumn("uint8", (self.grid_cells**2 // 8,), bits),
            "angular_grid": StoredColumn("float32", (self.angular_cells,), cones),
        }

    def compute(self, seen: Surroundings, dt_s: float) -> dict[str, np.ndarray]:
        """See `ModelFeatures`; "occupancy" is bit-packed, "angular_grid" are distances, m."""
        who, around = seen.observers, seen.around
        angular = angular_grids(
            who.position, who.heading_rad, around.position, around.track_id, who.track_id, around.span,
            self.angular_cells, self.max_range_m,
        )  # fmt: skip
        velocity = rotate(who.velocity, -who.heading_rad).astype(np.float32)
        crops = self.obstacle_inputs(seen.occupancy, who.position, who.heading_rad)
        return {"state": velocity, **crops, "angular_grid": angular}

    def obstacle_inputs(
        self, occupancy: OccupancyMap, position: np.ndarray, heading_rad: np.ndarray
    ) -> dict[str, np.ndarray]:
        """See `ModelFeatures`."""
        crops = occupancy_crops(occupancy, position, heading_rad, self.grid_cells, self.grid_resolution_m)
        return {"occupancy": crops}

    def channels(self, stored: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """See `ModelFeatures`; an empty cone is 0. The encoder's embedding is the channel "grid"."""
        closeness = 1.0 - stored["angular_grid"] / np.float32(self.max_range_m)
        return {"state": stored["state"], "angular": closeness}

    def empty_channels(self) -> dict[str, float]:
        """See `ModelFeatures`; the embedding of an empty crop is known to the encoder alone."""
        return {}

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """See `ModelFeatures`."""
        return {"state": (2,), "crop": (self.grid_cells, self.grid_cells), "angular": (self.angular_cells,)}

    def graph_inputs(self, stored: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """See `ModelFeatures`."""
        crops = unpack_crops(stored["occupancy"], self.grid_cells)
        return self.channels(stored) | {"crop": crops.astype(np.float32)}

    def past_s(self, dt_s: float) -> float:
        """None: the network's state remembers it."""
        return 0.0
