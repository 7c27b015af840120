"""numpy arrays <-> Parquet columns that plain `pandas.read_parquet` understands."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from pedpred.errors import StorageError

_ROWS_PER_GROUP = 8192
_REMEDY = "Rebuild it with dvc repro"


def write_columns(columns: Mapping[str, np.ndarray], path: Path) -> None:
    """Write arrays with a common first axis as one Parquet file (zstd, byte-identical each time).

    [M] becomes a plain column, [M, ...] of bytes a fixed-size binary one, any other [M, ...] a
    fixed-size list with the trailing axes flattened, row-major.
    """
    table = pa.table({name: _to_arrow(np.ascontiguousarray(values)) for name, values in columns.items()})
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path, compression="zstd", row_group_size=_ROWS_PER_GROUP, use_dictionary=False)


def read_columns(path: Path, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, np.ndarray]:
    """Read columns back as arrays.

    Args:
        path: a file of `write_columns`.
        shapes: wanted columns and their trailing axes, () for plain ones.

    Raises:
        StorageError: the file is damaged, or a column is missing or has another shape.
    """
    try:
        file = pq.ParquetFile(path)
        missing = [name for name in shapes if name not in file.schema_arrow.names]
        if missing:
            raise StorageError(path, f"column {missing[0]}", "it is missing", _REMEDY)
        table = file.read(columns=list(shapes))
    except (OSError, pa.ArrowException) as cause:
        raise StorageError(path, "file", str(cause).splitlines()[0], _REMEDY) from cause
    arrays = {}
    for name, shape in shapes.items():
        column = table[name].combine_chunks()
        try:
            arrays[name] = _from_arrow(column, shape)
        except ValueError as cause:
            problem = f"its type {column.type} does not fit the shape {shape}"
            raise StorageError(path, f"column {name}", problem, _REMEDY) from cause
    return arrays


def _to_arrow(values: np.ndarray) -> pa.Array:
    if values.ndim == 1:
        return pa.array(values)
    width = int(np.prod(values.shape[1:]))
    if values.dtype == np.uint8:
        return pa.Array.from_buffers(pa.binary(width), len(values), [None, pa.py_buffer(values)])
    return pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), width)


def _from_arrow(column: pa.Array, shape: tuple[int, ...]) -> np.ndarray:
    rows = len(column)
    if pa.types.is_fixed_size_binary(column.type):
        if (column.type.byte_width,) != shape:
            raise ValueError(shape)
        flat = np.frombuffer(column.buffers()[1], dtype=np.uint8)
        start = column.offset * column.type.byte_width
        return flat[start : start + rows * column.type.byte_width].reshape(rows, *shape)
    if pa.types.is_fixed_size_list(column.type):
        return column.flatten().to_numpy(zero_copy_only=False).reshape(rows, *shape)
    if shape:
        raise ValueError(shape)
    return column.to_numpy(zero_copy_only=False)
