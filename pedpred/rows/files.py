"""Rows on disk: a Parquet file per scene, world or viewing, and a manifest per set.

The frozen encoder's outputs for a set lie in files of the same names in another folder.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np

from pedpred.errors import InputError, brief
from pedpred.features import FeatureTable, StoredColumn
from pedpred.files import read_json, translate_errors, write_json
from pedpred.models.features import RowFormat
from pedpred.storage.columns import count_rows, read_blocks, write_blocks

SCHEMA = 5
_REPEATED = ("angular_grid",)
"""Byte-stream-split makes columns of float32 5-45 % smaller, but these larger: their values repeat."""
_REMEDY = "Write it again"


def columns_of(row_format: RowFormat) -> dict[str, StoredColumn]:
    """Every column: the inputs, the targets, and where tracks start if they are read step by step."""
    features, steps = row_format.features, row_format.protocol.horizon_steps
    future = StoredColumn("float32", (steps, 2), "m/s, agent frame (forward, left), row-major")
    columns = {**features.columns(), "future": future}
    if features.has_memory:
        columns |= {
            "future_steps": StoredColumn("int8", unit="steps of future that are known"),
            "track_id": StoredColumn("int64"),
            "step": StoredColumn("int32", unit="dt_s since the first step of the track"),
        }
    return columns


def step_columns(table: FeatureTable) -> dict[str, np.ndarray]:
    """Columns of rows that are the steps of tracks."""
    return {**table.columns, **table.inputs}


def write_shard(
    blocks: Iterable[Mapping[str, np.ndarray]], folder: Path, name: str, row_format: RowFormat
) -> None:
    """Write some rows as `<folder>/<name>.parquet`, a row group per block, as the blocks come.

    Args:
        blocks: at least one; the columns of `columns_of` among others, [M, ...] each. Tracks are not split.
        folder: of the set.
        name: of the scene, world or viewing.
        row_format: of the set.
    """
    wanted = columns_of(row_format)
    stored = (
        {key: block[key].astype(it.dtype, copy=False) for key, it in wanted.items()} for block in blocks
    )
    split = [key for key, it in wanted.items() if it.dtype == "float32" and key not in _REPEATED]
    write_blocks(stored, folder / f"{name}.parquet", SCHEMA, split=split)


def write_manifest(folder: Path, row_format: RowFormat, shards: Mapping[str, str]) -> None:
    """Write `manifest.json`: schema version, protocol, inputs, columns with units, files.

    Args:
        folder: of the set.
        row_format: protocol and inputs.
        shards: name -> what identifies its scene, which variants share; read in this order. Empty where a
            recording is not available.
    """
    columns = {name: asdict(column) for name, column in columns_of(row_format).items()}
    about = {"schema": SCHEMA, **row_format.plain(), "columns": columns}
    write_json(folder / "manifest.json", {**about, "shards": dict(shards)})


def scene_digest(scene: Path) -> str:
    """Checksum of a scene folder: names and bytes of its files, whichever it has."""
    digest = hashlib.sha256()
    for path in sorted(path for path in scene.iterdir() if path.is_file()):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


def read_manifest(folder: Path) -> tuple[RowFormat, dict[str, str]]:
    """What the rows of a set were made with, and its files: name -> what identifies the scene.

    Raises:
        InputError: the manifest is missing, damaged or of another schema version, or names files elsewhere.
    """
    path = folder / "manifest.json"
    wording = partial(InputError, path, "manifest", remedy=_REMEDY)
    about = read_json(path, wording)
    with translate_errors(wording):
        if about["schema"] != SCHEMA:
            raise InputError(path, "schema", f"{brief(about['schema'])}, expected {SCHEMA}", _REMEDY)
        shards = {name: str(scene) for name, scene in about["shards"].items()}
        for name in shards:
            if Path(name).name != name:
                raise InputError(
                    path, "shards", f"{brief(name)} is no name of a file in this folder", _REMEDY
                )
        return RowFormat.parse(about), shards


def count_rows_of(folder: Path) -> int:
    """Number of rows of a set; places without recording have none.

    Raises:
        InputError: the manifest or a file is damaged.
    """
    return sum(count_rows(folder / f"{name}.parquet") for name in read_manifest(folder)[1])


def read_shard(folder: Path, name: str, row_format: RowFormat) -> Iterator[dict[str, np.ndarray]]:
    """Read a file block by block; columns and types are those of `columns_of`.

    Raises:
        InputError: the file is damaged or of another schema version, or a column is missing or of
            another type or size; it names file and field.
    """
    return _read(folder / f"{name}.parquet", columns_of(row_format))


def read_crops(folder: Path, name: str, row_format: RowFormat) -> Iterator[np.ndarray]:
    """Read only the bit-packed crops of a file, block by block: [m, cells^2 / 8] uint8."""
    wanted = {"occupancy": columns_of(row_format)["occupancy"]}
    return (block["occupancy"] for block in _read(folder / f"{name}.parquet", wanted))


def _read(
    path: Path, wanted: Mapping[str, StoredColumn], version: int | None = SCHEMA
) -> Iterator[dict[str, np.ndarray]]:
    for block in read_blocks(path, {name: column.shape for name, column in wanted.items()}, version):
        for name, column in wanted.items():
            if block[name].dtype != column.dtype:
                problem = f"it is {block[name].dtype}, expected {column.dtype}"
                raise InputError(path, f"column {name}", problem, _REMEDY)
        yield block


def write_embeddings(blocks: Iterable[np.ndarray], folder: Path, name: str) -> None:
    """Write the frozen encoder's outputs, row for row with a file's blocks. [m, C] float16 each."""
    write_blocks(({"embedding": embeddings} for embeddings in blocks), folder / f"{name}.parquet")


def read_embeddings(folder: Path, name: str) -> Iterator[np.ndarray]:
    """Read the encoder's outputs of a file, block by block: [m, C] float16; errors of `read_shard`."""
    wanted = {"embedding": StoredColumn("float16", (-1,))}
    return (block["embedding"] for block in _read(folder / f"{name}.parquet", wanted, version=None))
