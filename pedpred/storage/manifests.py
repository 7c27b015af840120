"""Folders of Parquet files with a manifest: schema version, protocol, inputs, columns with units, files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.errors import InputError, brief
from pedpred.features import StoredColumn
from pedpred.files import read_json, translate_errors, write_json
from pedpred.models.features import RowFormat
from pedpred.storage.columns import read_blocks

_REMEDY = "Write it again"


def read_typed_blocks(
    path: Path, wanted: Mapping[str, StoredColumn], schema: int | None = None
) -> Iterator[dict[str, np.ndarray]]:
    """Read columns block by block, as `read_blocks` does, and check their types.

    Raises:
        InputError: the file is damaged or of another schema version, or a column is missing or of
            another type or size; it names file and field.
    """
    for columns in read_blocks(path, {name: column.shape for name, column in wanted.items()}, schema):
        for name, column in wanted.items():
            if columns[name].dtype != column.dtype:
                problem = f"it is {columns[name].dtype}, expected {column.dtype}"
                raise InputError(path, f"column {name}", problem, _REMEDY)
        yield columns


def write_about(
    folder: Path,
    schema: int,
    made_with: RowFormat,
    columns: Mapping[str, StoredColumn],
    files: Mapping[str, Any],
) -> None:
    """Write `manifest.json`.

    Args:
        folder: of the files.
        schema: version of the columns' meaning.
        made_with: protocol and inputs.
        columns: of each file.
        files: one entry, which names them.
    """
    listed = {name: asdict(column) for name, column in columns.items()}
    about = {"schema": schema, **made_with.plain(), "columns": listed, **files}
    write_json(folder / "manifest.json", about)


def read_manifest_of(folder: Path, schema: int, files: str) -> tuple[RowFormat, Any]:
    """Read what the rows of a folder were made with, and the entry that names its files.

    Args:
        folder: of the files.
        schema: expected version.
        files: name of the entry.

    Raises:
        InputError: the manifest is missing, damaged or of another schema version, or names files elsewhere.
    """
    path = folder / "manifest.json"
    wording = partial(InputError, path, "manifest", remedy=_REMEDY)
    about = read_json(path, wording)
    with translate_errors(wording):
        if about["schema"] != schema:
            raise InputError(path, "schema", f"{brief(about['schema'])}, expected {schema}", _REMEDY)
        for name in about[files]:
            if Path(name).name != name:
                raise InputError(path, files, f"{brief(name)} is no name of a file in this folder", _REMEDY)
        return RowFormat.parse(about), about[files]
