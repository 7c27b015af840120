"""Evaluation windows of one scene with what every method forecast for them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from pedpred.errors import StorageError
from pedpred.files import translate_errors
from pedpred.geometry import rotate
from pedpred.storage.columns import read_columns

CELL_M = 0.1
"""Side of a cell of the obstacle grid, m."""
RANGE_M = 6.0
"""Range of the angular pedestrian grid (APG), m; also the value of an empty cell."""

_PATH, _COVARIANCE = "path_", "covariance_"
_PLAIN = ("track_id", "time_s", "x_m", "y_m", "heading_rad", "vx_mps", "vy_mps")
_REMEDY = "Evaluate again (dvc repro)"


@dataclass(frozen=True)
class Windows:
    """One row per evaluation window. W windows, P prediction steps, K angular cells.

    Attributes:
        track_id: whose window. [W]
        time_s: the present, s. [W]
        position: tracked, world frame, m. [W, 2]
        heading_rad: counter-clockwise from world x. [W]
        velocity: tracked, agent frame (forward, left), m/s. [W, 2]
        packed_grid: bits of the obstacle grid, little end first. [W, bytes] uint8
        angular_grid_m: distance of the nearest pedestrian per cone, counted counter-clockwise
            from the heading; `RANGE_M` is empty. [W, K]
        truth: true positions, world frame, m. [W, P, 2]
        paths: forecast positions of each method, world frame, m. {method: [W, P, 2]}
        covariances: of these, from methods that tell them, m^2. {method: [W, P, 2, 2]}
    """

    track_id: np.ndarray
    time_s: np.ndarray
    position: np.ndarray
    heading_rad: np.ndarray
    velocity: np.ndarray
    packed_grid: np.ndarray
    angular_grid_m: np.ndarray
    truth: np.ndarray
    paths: dict[str, np.ndarray]
    covariances: dict[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.track_id)

    @property
    def world_velocity(self) -> np.ndarray:
        """World frame, m/s: [W, 2]."""
        return rotate(self.velocity, self.heading_rad)

    def grid(self, row: int) -> np.ndarray:
        """Obstacle cells around one agent, (forward, left), the agent in the middle: [G, G] bool."""
        cells = np.unpackbits(self.packed_grid[row], bitorder="little").astype(bool)
        side = int(np.sqrt(cells.size))
        return cells[: side * side].reshape(side, side)

    def ade_m(self, method: str) -> np.ndarray:
        """Error of a method averaged over the steps, m: [W]."""
        return np.linalg.norm(self.paths[method] - self.truth, axis=-1).mean(axis=-1)


def read_windows(path: Path) -> Windows:
    """Read the forecasts of one scene.

    Raises:
        StorageError: the file cannot be read, or a column is missing or has another type; it is named.
    """
    with translate_errors(partial(StorageError, path, "file", remedy=_REMEDY)):
        types = {column.name: column.type for column in pq.read_schema(path)}
        shapes: dict[str, tuple[int, ...]] = {name: () for name in _PLAIN}
        shapes |= {name: (_width(types, name),) for name in ("grid", "angular_grid")}
        forecasts = [name for name in types if name.startswith(_PATH)]
        shapes |= {name: (_width(types, name) // 2, 2) for name in ("truth", *forecasts)}
        spreads = [name for name in types if name.startswith(_COVARIANCE)]
        shapes |= {name: (_width(types, name) // 4, 2, 2) for name in spreads}
    columns = read_columns(path, shapes)
    return Windows(
        track_id=columns["track_id"],
        time_s=columns["time_s"],
        position=np.column_stack([columns["x_m"], columns["y_m"]]),
        heading_rad=columns["heading_rad"],
        velocity=np.column_stack([columns["vx_mps"], columns["vy_mps"]]),
        packed_grid=columns["grid"],
        angular_grid_m=columns["angular_grid"],
        truth=columns["truth"].astype(np.float64),
        paths={name.removeprefix(_PATH): columns[name].astype(np.float64) for name in forecasts},
        covariances={name.removeprefix(_COVARIANCE): columns[name].astype(np.float64) for name in spreads},
    )


def _width(types: dict[str, pa.DataType], name: str) -> int:
    """Values or bytes per row of a column of fixed width; 0 if it is missing or something else."""
    kind = types.get(name, pa.null())
    if pa.types.is_fixed_size_list(kind):
        return kind.list_size
    return kind.byte_width if pa.types.is_fixed_size_binary(kind) else 0
