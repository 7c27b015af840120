"""Feature tables and grid codes on disk: one Parquet shard per scene, one manifest per folder."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.errors import StorageError
from pedpred.features import FeatureSettings, FeatureTable
from pedpred.storage.columns import read_columns, write_columns

FEATURE_SCHEMA = 1
_REMEDY = "Rebuild it with dvc repro"
_PAIRS = {
    "position": ("x_m", "y_m"),
    "velocity": ("vx_mps", "vy_mps"),
    "last_position": ("last_x_m", "last_y_m"),
    "last_velocity": ("last_vx_mps", "last_vy_mps"),
    "last_acceleration": ("last_ax_mps2", "last_ay_mps2"),
}
_UNITS = {
    "time_s": "s",
    "x_m, y_m, last_x_m, last_y_m": "m, world",
    "heading_rad": "rad, counter-clockwise from world x",
    "vx_mps, vy_mps": "m/s, agent frame (forward, left)",
    "last_vx_mps, last_vy_mps": "m/s, world",
    "last_ax_mps2, last_ay_mps2": "m/s^2, world",
    "occupancy": "bits, cell (i forward, j left) is bit i * grid_cells + j, least significant first",
    "angular_grid": "m, cone k covers [k, k+1) * 2 pi / angular_cells from the heading",
    "future": "m/s, agent frame, [horizon_steps, 2] row-major",
}


def feature_columns(table: FeatureTable) -> dict[str, np.ndarray]:
    """The table as named columns, pairs split into x and y."""
    columns: dict[str, np.ndarray] = {}
    for field in fields(table):
        value = getattr(table, field.name)
        if field.name in _PAIRS:
            columns |= dict(zip(_PAIRS[field.name], value.T, strict=True))
        else:
            columns[field.name] = value
    return columns


def write_shard(table: FeatureTable, folder: Path, name: str) -> None:
    """Write the feature table of one scene as `<folder>/<name>.parquet`."""
    write_columns(feature_columns(table), folder / f"{name}.parquet")


def write_manifest(folder: Path, settings: FeatureSettings, sources: dict[str, Path]) -> None:
    """Write `manifest.json`: schema, units, sizes, and the hash of each shard's source scene."""
    hashes = {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in sources.items()}
    about = {
        "schema": FEATURE_SCHEMA,
        "units": _UNITS,
        "settings": asdict(settings),
        "shards": {name: {"tracks_sha256": digest} for name, digest in sorted(hashes.items())},
    }
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "manifest.json").write_text(json.dumps(about, indent=1) + "\n")


def read_manifest(folder: Path) -> tuple[FeatureSettings, list[str]]:
    """Sizes and shard names of a feature folder.

    Raises:
        StorageError: the manifest is missing, damaged or of another schema version.
    """
    path = folder / "manifest.json"
    try:
        about: dict[str, Any] = json.loads(path.read_text())
        if about["schema"] != FEATURE_SCHEMA:
            raise StorageError(path, "schema", f"{about['schema']!r}, expected {FEATURE_SCHEMA}", _REMEDY)
        return FeatureSettings(**about["settings"]), list(about["shards"])
    except (OSError, ValueError, TypeError, KeyError) as cause:
        raise StorageError(path, "manifest", f"{type(cause).__name__}: {cause}", _REMEDY) from cause


def read_shard(folder: Path, name: str, settings: FeatureSettings) -> FeatureTable:
    """Read one scene's feature table.

    Raises:
        StorageError: the shard is damaged or lacks a column; it names file and field.
    """
    trailing = {
        "occupancy": (settings.grid_cells**2 // 8,),
        "angular_grid": (settings.angular_cells,),
        "future": (settings.horizon_steps, 2),
    }
    names = [column for f in fields(FeatureTable) for column in _PAIRS.get(f.name, (f.name,))]
    columns = read_columns(folder / f"{name}.parquet", {n: trailing.get(n, ()) for n in names})
    for field, pair in _PAIRS.items():
        columns[field] = np.stack([columns.pop(column) for column in pair], axis=-1)
    return FeatureTable(**columns)


def write_codes(codes: np.ndarray, folder: Path, name: str) -> None:
    """Write the frozen encoder's outputs, row for row with the shard's features. [M, C] float16."""
    write_columns({"code": codes}, folder / f"{name}.parquet")


def read_codes(folder: Path, name: str) -> np.ndarray:
    """Read the encoder's outputs of one scene. [M, C] float16."""
    return read_columns(folder / f"{name}.parquet", {"code": (-1,)})["code"]
