"""Situations on disk, the training rows of networks without memory: one Parquet file per world or viewing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from pedpred.features import StoredColumn
from pedpred.models.features import RowFormat
from pedpred.storage.columns import write_blocks
from pedpred.storage.manifests import read_manifest_of, read_typed_blocks, write_about

SITUATION_SCHEMA = 2


def situation_columns(made_with: RowFormat) -> dict[str, StoredColumn]:
    """Every column: the model's inputs and the targets. Agent frame."""
    future = StoredColumn("float32", (made_with.protocol.horizon_steps, 2), "m/s (forward, left), row-major")
    return made_with.features.columns() | {"future": future}


def write_situations(
    columns: Mapping[str, np.ndarray], folder: Path, name: str, wanted: Mapping[str, StoredColumn]
) -> None:
    """Write the rows of one world or viewing as `<folder>/<name>.parquet`.

    Args:
        columns: input -> [M, width], and `future`, [M, P, 2].
        folder: of the set.
        name: of the world or viewing.
        wanted: types on disk, see `situation_columns`.
    """
    stored = {key: value.astype(wanted[key].dtype) for key, value in columns.items()}
    full = [key for key, value in stored.items() if value.dtype == np.float32]
    write_blocks([stored], folder / f"{name}.parquet", SITUATION_SCHEMA, split=full)


def write_situations_manifest(folder: Path, made_with: RowFormat, names: Sequence[str]) -> None:
    """Write `manifest.json`: schema version, protocol, inputs, columns with units, names of the files.

    Args:
        folder: of the set.
        made_with: protocol and inputs.
        names: of the worlds or viewings; none where a recording is not available.
    """
    write_about(folder, SITUATION_SCHEMA, made_with, situation_columns(made_with), {"names": list(names)})


def read_situations_manifest(folder: Path) -> tuple[RowFormat, list[str]]:
    """What a set was made with, and the names of its files.

    Raises:
        InputError: the manifest is missing, damaged or of another schema version.
    """
    return read_manifest_of(folder, SITUATION_SCHEMA, "names")


def read_situations(folder: Path, name: str, made_with: RowFormat) -> dict[str, np.ndarray]:
    """Read the rows of one world or viewing; types are those of `situation_columns`.

    Returns:
        Input -> [M, width], and `future`, [M, P, 2].

    Raises:
        InputError: the file is damaged or of another schema version, or a column is missing or of
            another type or size; it names file and field.
    """
    path, wanted = folder / f"{name}.parquet", situation_columns(made_with)
    blocks = list(read_typed_blocks(path, wanted, SITUATION_SCHEMA))
    return {column: np.concatenate([block[column] for block in blocks]) for column in wanted}
