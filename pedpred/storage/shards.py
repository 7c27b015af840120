"""Feature tables and grid embeddings on disk: one Parquet shard per scene, one manifest per folder."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path

import numpy as np

from pedpred.errors import InputError
from pedpred.features import FeatureTable, StoredColumn
from pedpred.files import translate_errors
from pedpred.models.features import RowFormat
from pedpred.storage.columns import PAIRS, count_rows, join_pairs, split_pairs, write_blocks
from pedpred.storage.manifests import read_manifest_of, read_typed_blocks, write_about

FEATURE_SCHEMA = 4
_NEVER_REPEATED = ("time_s", "x_m", "y_m", "future")
"""Byte-stream-split makes these 5-45 % smaller, and those that hold their values up to 3 times larger."""


def columns_of(made_with: RowFormat) -> dict[str, StoredColumn]:
    """Every column of a shard, pairs split into x and y."""
    steps = made_with.protocol.horizon_steps
    by_field = {
        "track_id": StoredColumn("int64"),
        "phase": StoredColumn("int8"),
        "step": StoredColumn("int32", unit="dt_s since the first step of (track_id, phase)"),
        "time_s": StoredColumn("float64", unit="s"),
        "position": StoredColumn("float64", unit="m, world"),
        "heading_rad": StoredColumn("float64", unit="rad, counter-clockwise from world x"),
        "velocity": StoredColumn("float32", unit="m/s, agent frame (forward, left)"),
        "last_position": StoredColumn("float64", unit="m, world"),
        "last_velocity": StoredColumn("float64", unit="m/s, world"),
        "last_acceleration": StoredColumn("float64", unit="m/s^2, world"),
        **made_with.features.columns(),
        "future": StoredColumn("float32", (steps, 2), "m/s, agent frame, row-major"),
        "future_steps": StoredColumn("int8", unit="steps of future that are known"),
    }
    return {name: about for field, about in by_field.items() for name in PAIRS.get(field, (field,))}


def write_shard(blocks: Iterable[FeatureTable], folder: Path, name: str) -> None:
    """Write one scene as `<folder>/<name>.parquet`, a row group per block, as the blocks come.

    Args:
        blocks: of whole tracks, at least one (`pedpred.features.extract_blocks`).
        folder: of the scene set.
        name: of the scene.
    """
    columns = (split_pairs(_ordered(block)) for block in blocks)
    write_blocks(columns, folder / f"{name}.parquet", FEATURE_SCHEMA, split=_NEVER_REPEATED)


def _ordered(table: FeatureTable) -> dict[str, np.ndarray]:
    """Its columns, the inputs before the targets."""
    targets = {name: table.columns[name] for name in ("future", "future_steps")}
    states = {name: values for name, values in table.columns.items() if name not in targets}
    return {**states, **table.inputs, **targets}


def write_manifest(folder: Path, made_with: RowFormat, scenes: Mapping[str, Path]) -> None:
    """Write `manifest.json`: schema version, protocol, inputs, columns with units, sources.

    Args:
        folder: of the shards.
        made_with: protocol and inputs.
        scenes: the scene folder behind each shard, by name.
    """
    shards = {name: {"scene_sha256": _digest(scene)} for name, scene in sorted(scenes.items())}
    write_about(folder, FEATURE_SCHEMA, made_with, columns_of(made_with), {"shards": shards})


def _digest(scene: Path) -> str:
    """Checksum of a scene folder: names and bytes of its files, whichever it has."""
    digest = hashlib.sha256()
    for path in sorted(path for path in scene.iterdir() if path.is_file()):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


def read_manifest(folder: Path) -> tuple[RowFormat, dict[str, str]]:
    """What a feature folder was made with, and its shards: name -> digest of its scene, which variants share.

    Raises:
        InputError: the manifest is missing, damaged or of another schema version.
    """
    made_with, shards = read_manifest_of(folder, FEATURE_SCHEMA, "shards")
    with translate_errors(partial(InputError, folder / "manifest.json", "shards", remedy="Write it again")):
        return made_with, {name: str(shard["scene_sha256"]) for name, shard in shards.items()}


def has_rows(folder: Path) -> bool:
    """Return whether a feature folder has any row; places without recording have none.

    Raises:
        InputError: the manifest or a shard is damaged.
    """
    return any(count_rows(folder / f"{name}.parquet") for name in read_manifest(folder)[1])


def read_shard(folder: Path, name: str, made_with: RowFormat) -> FeatureTable:
    """Read one scene's feature table; errors of `read_typed_blocks`."""
    return FeatureTable.join(list(read_shard_blocks(folder, name, made_with)))


def read_shard_blocks(folder: Path, name: str, made_with: RowFormat) -> Iterator[FeatureTable]:
    """Read one scene's feature table block by block, whole tracks each; errors of `read_typed_blocks`."""
    for columns in read_typed_blocks(folder / f"{name}.parquet", columns_of(made_with), FEATURE_SCHEMA):
        table = join_pairs(columns)
        inputs = {column: table.pop(column) for column in made_with.features.columns()}
        yield FeatureTable(**table, inputs=inputs)


def read_crops(folder: Path, name: str, made_with: RowFormat) -> Iterator[np.ndarray]:
    """Read only the bit-packed crops of one scene, block by block: [m, cells^2 / 8] uint8."""
    wanted = {"occupancy": columns_of(made_with)["occupancy"]}
    blocks = read_typed_blocks(folder / f"{name}.parquet", wanted, FEATURE_SCHEMA)
    return (columns["occupancy"] for columns in blocks)


def write_embeddings(blocks: Iterable[np.ndarray], folder: Path, name: str) -> None:
    """Write the frozen encoder's outputs, row for row with the shard's blocks. [m, C] float16 each."""
    write_blocks(({"embedding": embeddings} for embeddings in blocks), folder / f"{name}.parquet")


def read_embeddings(folder: Path, name: str) -> Iterator[np.ndarray]:
    """Read the encoder's outputs of one scene, block by block: [m, C] float16."""
    blocks = read_typed_blocks(folder / f"{name}.parquet", {"embedding": StoredColumn("float16", (-1,))})
    return (columns["embedding"] for columns in blocks)
