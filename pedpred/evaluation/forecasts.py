"""Evaluation windows of one scene with the predictions of some methods."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from pedpred.errors import InputError, ValueRuleError, shape_error
from pedpred.files import translate_errors
from pedpred.geometry import rotate
from pedpred.scenes import Predictions
from pedpred.storage.columns import PAIRS, join_pairs, read_about, read_columns, split_pairs, write_columns

_POINT, _MODES, _WEIGHT, _COVARIANCE = "point_", "modes_", "weight_", "covariance_"
_PLAIN = ("track_id", "time_s", "position", "heading_rad", "velocity")
_GRIDS = {"grid": "packed_grid", "angular_grid": "angular_grid_m"}  # column -> field
SIZES = ("dt_s", "grid_cells", "grid_resolution_m", "max_range_m")
_REMEDY = "Evaluate again"


@dataclass(frozen=True)
class EvaluationWindows:
    """One row per evaluation window. W windows, P prediction steps, C angular cells.

    Attributes:
        track_id: of each window. [W]
        time_s: the present, s. [W]
        position: tracked, world frame, m. [W, 2]
        heading_rad: counter-clockwise from world x. [W]
        velocity: tracked, agent frame (forward, left), m/s. [W, 2]
        packed_grid: bits of the obstacle grid ("occupancy" of `LstmFeatures`), little end first; no columns
            if no method reads it. [W, bytes] uint8
        angular_grid_m: distance of the nearest pedestrian per cone, counted counter-clockwise
            from the heading; `max_range_m` is empty; no columns likewise. [W, C]
        truth: true positions, world frame, m. [W, P, 2]
        predictions: of each method, world frame. {method: [W]}
        dt_s: time between two steps, s.
        grid_cells: cells per side of the obstacle grid.
        grid_resolution_m: side of such a cell, m.
        max_range_m: range of the angular grid, m.
    """

    track_id: np.ndarray
    time_s: np.ndarray
    position: np.ndarray
    heading_rad: np.ndarray
    velocity: np.ndarray
    packed_grid: np.ndarray
    angular_grid_m: np.ndarray
    truth: np.ndarray
    predictions: dict[str, Predictions]
    dt_s: float
    grid_cells: int = 0
    grid_resolution_m: float = 0.0
    max_range_m: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray) and len(value) != len(self):
                raise shape_error(field.name, value.shape, f"[{len(self)}, ...]")
        for method, forecasts in self.predictions.items():
            if forecasts.point.shape != self.truth.shape:
                raise shape_error(
                    f"predictions[{method!r}].point", forecasts.point.shape, str(self.truth.shape)
                )

    def __len__(self) -> int:
        return len(self.track_id)

    @property
    def world_velocity(self) -> np.ndarray:
        """World frame, m/s: [W, 2]."""
        return rotate(self.velocity, self.heading_rad)

    @property
    def with_covariances(self) -> tuple[str, ...]:
        """Methods that give covariances."""
        return tuple(method for method, given in self.predictions.items() if given.covariance is not None)

    def grid(self, row: int) -> np.ndarray:
        """Unpack the obstacle cells around an agent, (forward, left), agent in the middle: [G, G] bool."""
        cells = np.unpackbits(self.packed_grid[row], count=self.grid_cells**2, bitorder="little")
        return cells.reshape(self.grid_cells, self.grid_cells).astype(bool)

    def ade_m(self, method: str) -> np.ndarray:
        """Average the error of a method over the steps, m: [W]."""
        return np.linalg.norm(self.predictions[method].point - self.truth, axis=-1).mean(axis=-1)


def write_windows(windows: EvaluationWindows, path: Path) -> None:
    """Write windows as Parquet; predicted and true positions become float32, sizes file metadata."""
    columns = {
        **split_pairs({name: getattr(windows, name) for name in _PLAIN}),
        **{name: grid for name, field in _GRIDS.items() if (grid := getattr(windows, field)).shape[1]},
        "truth": windows.truth.astype(np.float32),
    }
    modes = {}
    for method, forecasts in windows.predictions.items():
        columns[_POINT + method] = forecasts.point.astype(np.float32)
        if forecasts.modes > 1:
            modes[method] = forecasts.modes
            columns[_MODES + method] = forecasts.path.astype(np.float32)
            columns[_WEIGHT + method] = forecasts.weight.astype(np.float32)
        if forecasts.covariance is not None:
            columns[_COVARIANCE + method] = forecasts.covariance.astype(np.float32)
    write_columns(columns, path, {name: getattr(windows, name) for name in SIZES} | {"modes": modes})


def read_windows(path: Path) -> EvaluationWindows:
    """Read the windows of one scene.

    Raises:
        InputError: the file cannot be read, or a column is missing or has another type; it is named.
    """
    with translate_errors(partial(InputError, path, "file", remedy=_REMEDY)):
        types = {column.name: column.type for column in pq.read_schema(path)}
        about = read_about(path)
        sizes, modes = {name: about[name] for name in SIZES}, about["modes"]
        steps = _width(types, "truth") // 2
        shapes: dict[str, tuple[int, ...]] = {
            name: () for field in _PLAIN for name in PAIRS.get(field, (field,))
        }
        shapes |= {name: (-1,) for name in _GRIDS if name in types} | {"truth": (steps, 2)}
        methods = [name.removeprefix(_POINT) for name in types if name.startswith(_POINT)]
        for method in methods:
            shapes |= _prediction_shapes(method, modes.get(method, 1), steps, types)
        columns = join_pairs(read_columns(path, shapes))
        plain: dict[str, Any] = {name: columns[name] for name in _PLAIN}
        return EvaluationWindows(
            **plain,
            packed_grid=columns.get("grid", np.zeros((len(columns["truth"]), 0), np.uint8)),
            angular_grid_m=columns.get("angular_grid", np.zeros((len(columns["truth"]), 0), np.float32)),
            truth=columns["truth"].astype(np.float64),
            predictions={method: _predictions(method, columns, sizes["dt_s"]) for method in methods},
            **sizes,
        )


def read_forecasts(
    root: Path, networks: str, at: str, methods: Iterable[str], scene: str = "*"
) -> dict[str, EvaluationWindows]:
    """Read what some methods forecast in the scenes of a test set.

    Args:
        root: the project's folder.
        networks: whose weights are tested there: main, or a fold.
        at: the test set, kind/name.
        methods: their keys, in the order of the predictions; what was not forecast is left out.
        scene: its name, or a pattern.

    Raises:
        InputError: a file cannot be read.
        ValueRuleError: two methods forecast different windows.
    """
    parts: dict[str, list[EvaluationWindows]] = {}
    for method in methods:
        for folder in result_folders(root / "data/forecasts", method, networks):
            for path in sorted((folder / at).glob(f"{scene}.parquet")):
                parts.setdefault(path.stem, []).append(read_windows(path))
    return {name: join_windows(windows) for name, windows in parts.items()}


def result_folders(top: Path, method: str, networks: str) -> tuple[Path, Path]:
    """Folders below data/forecasts or data/scores that may hold a method's results, a folder per test set.

    Args:
        top: the folder.
        method: its key; a simple method has no weights, and the first of these.
        networks: whose weights are tested: main, or a fold.
    """
    trained = Path("main", method) if networks == "main" else Path("folds", method, networks)
    return top / "baselines" / method, top / trained


def join_windows(parts: Sequence[EvaluationWindows]) -> EvaluationWindows:
    """Put the predictions of the same windows together, and the grids of the first part that has them.

    Args:
        parts: at least one.

    Raises:
        ValueRuleError: two parts are about other windows.
    """
    for part in parts:
        for name in ("track_id", "time_s"):
            if not np.array_equal(getattr(part, name), getattr(parts[0], name)):
                raise ValueRuleError(
                    name, list(part.predictions), "all methods must forecast the same windows"
                )
    predictions = {method: forecasts for part in parts for method, forecasts in part.predictions.items()}
    return replace(max(parts, key=lambda part: part.packed_grid.shape[1]), predictions=predictions)


def _prediction_shapes(
    method: str, modes: int, steps: int, types: dict[str, pa.DataType]
) -> dict[str, tuple[int, ...]]:
    """Shapes per row of the columns of one method."""
    shapes: dict[str, tuple[int, ...]] = {_POINT + method: (steps, 2)}
    if modes > 1:
        shapes |= {_MODES + method: (modes, steps, 2), _WEIGHT + method: (modes,)}
    if _COVARIANCE + method in types:
        shapes[_COVARIANCE + method] = (modes, steps, 2, 2)
    return shapes


def _predictions(method: str, columns: dict[str, np.ndarray], dt_s: float) -> Predictions:
    arrays = {
        prefix: columns[prefix + method].astype(np.float64)
        for prefix in (_POINT, _MODES, _WEIGHT, _COVARIANCE)
        if prefix + method in columns
    }
    point, covariance = arrays[_POINT], arrays.get(_COVARIANCE)
    if _MODES in arrays:
        return Predictions(point, arrays[_MODES], arrays[_WEIGHT], dt_s, covariance)
    return Predictions.single(point, dt_s, None if covariance is None else covariance[:, 0])


def _width(types: dict[str, pa.DataType], name: str) -> int:
    """Values per row of a column of fixed width; 0 if it is missing or something else."""
    kind = types.get(name, pa.null())
    return kind.list_size if pa.types.is_fixed_size_list(kind) else 0
