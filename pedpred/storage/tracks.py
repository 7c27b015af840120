"""Trajectories <-> columns with units in their names, and `tracks.parquet`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pedpred.errors import InputError
from pedpred.files import atomic_write, translate_errors
from pedpred.scenes import Trajectories
from pedpred.storage.columns import column_names, count_rows, read_columns

MOST_NUMBERS = 10_000_000
"""Limit for the numbers of a table, 80 MB: two million detections with time, id, x and y."""

_PAIRS = {"position": ("x_m", "y_m"), "velocity": ("vx_mps", "vy_mps"), "goal": ("goal_x_m", "goal_y_m")}
_COLUMNS = {field.name: _PAIRS.get(field.name, (field.name,)) for field in fields(Trajectories)}
TRACK_COLUMNS = tuple(name for names in _COLUMNS.values() for name in names)
"""Columns of all fields of `Trajectories`."""
_REMEDY = "Correct the file or write the scene again"


def tracks_table(trajectories: Trajectories) -> pd.DataFrame:
    """Return trajectories as columns with units in their names."""
    columns: dict[str, np.ndarray] = {}
    for field, names in _COLUMNS.items():
        value = getattr(trajectories, field)
        if value is not None:
            columns |= dict(zip(names, np.atleast_2d(value.T), strict=True))
    return pd.DataFrame(columns)


def tracks_of(table: Mapping[str, Any] | pd.DataFrame, path: Path) -> Trajectories:
    """Return the trajectories in the columns of `tracks_table`; `path` is the file for error messages.

    Raises:
        InputError: a column is missing or holds no numbers; it is named.
    """
    values: dict[str, np.ndarray] = {}
    for field, names in _COLUMNS.items():
        missing = [name for name in names if name not in table]
        if missing and field in ("time_s", "track_id", "position"):
            raise InputError(path, f"column {missing[0]}", "it is missing", _REMEDY)
        if missing:
            continue
        columns = [np.asarray(table[name]) for name in names]
        for name, column in zip(names, columns, strict=True):
            if column.dtype.kind not in "biuf":
                raise InputError(path, f"column {name}", f"{column.dtype}, not numbers", _REMEDY)
        values[field] = np.stack(columns, axis=-1) if len(columns) > 1 else columns[0]
    return Trajectories(**values)


def write_parquet_tracks(trajectories: Trajectories, path: Path) -> None:
    """Write trajectories as Parquet."""
    with atomic_write(path) as new:
        tracks_table(trajectories).to_parquet(new, index=False, compression="zstd")


def read_parquet_tracks(path: Path) -> Trajectories:
    """Read trajectories from Parquet; only their columns are decoded.

    Raises:
        InputError: the file is missing, damaged or too long, or a column is missing or holds no numbers.
    """
    names = [name for name in column_names(path) if name in TRACK_COLUMNS]
    rows = count_rows(path)
    if rows * len(names) > MOST_NUMBERS:
        problem = f"{rows} rows of {len(names)} numbers, at most {MOST_NUMBERS} numbers are read"
        raise InputError(path, "file", problem, "Divide the recording")
    columns = read_columns(path, dict.fromkeys(names, ()))
    with translate_errors(partial(InputError, path, "file", remedy=_REMEDY)):
        return tracks_of(columns, path)
