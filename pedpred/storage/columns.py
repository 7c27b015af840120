"""numpy arrays <-> Parquet columns that plain `pandas.read_parquet` understands."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from pedpred.errors import InputError
from pedpred.files import atomic_write, translate_errors
from pedpred.plain import parse_json

_VERSION_KEY = b"pedpred.schema"
_ABOUT_KEY = b"pedpred.about"
_REMEDY = "Write it again"
_LARGEST_BYTES, _DENSEST = 2**27, 64
"""Limits for the decoded columns of a row group: this size, or this multiple of the file's size."""


PAIRS = {
    "position": ("x_m", "y_m"),
    "velocity": ("vx_mps", "vy_mps"),
    "last_position": ("last_x_m", "last_y_m"),
    "last_velocity": ("last_vx_mps", "last_vy_mps"),
    "last_acceleration": ("last_ax_mps2", "last_ay_mps2"),
}
"""Fields of x and y, [M, 2], and their columns."""


def split_pairs(values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Fields as named columns: those of `PAIRS` become two."""
    columns: dict[str, np.ndarray] = {}
    for name, value in values.items():
        columns |= dict(zip(PAIRS[name], value.T, strict=True)) if name in PAIRS else {name: value}
    return columns


def join_pairs(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The inverse of `split_pairs`."""
    pairs = {name: pair for name, pair in PAIRS.items() if pair[0] in columns}
    joined = {
        name: np.stack([columns.pop(column) for column in pair], axis=-1) for name, pair in pairs.items()
    }
    return columns | joined


def write_columns(
    columns: Mapping[str, np.ndarray], path: Path, about: Mapping[str, Any] | None = None
) -> None:
    """Write arrays with a common first axis as a Parquet file of one row group; see `write_blocks`."""
    write_blocks([columns], path, about=about)


def write_blocks(
    blocks: Iterable[Mapping[str, np.ndarray]],
    path: Path,
    version: int | None = None,
    split: Sequence[str] = (),
    about: Mapping[str, Any] | None = None,
) -> None:
    """Write blocks of rows as one Parquet file, one row group each; a block is let go when the next comes.

    [M] becomes a plain column, [M, ...] of bytes a fixed-size binary one, any other [M, ...] a
    fixed-size list with the trailing axes flattened, row-major. Compressed with zstd, byte-identical
    each time.

    Args:
        blocks: at least one; the same columns in all.
        path: the file; its folder is made.
        version: of the columns' meaning, kept in the file.
        split: columns whose floats are stored byte-stream-split, which pays where values do not repeat.
        about: plain values about the file; `read_about` reads them back.
    """
    writer: pq.ParquetWriter | None = None
    metadata = {} if version is None else {_VERSION_KEY: str(version)}
    metadata |= {} if about is None else {_ABOUT_KEY: json.dumps(about)}
    with atomic_write(path) as new, ExitStack() as open_files:
        for columns in blocks:
            table = pa.table({n: _to_arrow(np.ascontiguousarray(v)) for n, v in columns.items()})
            if metadata:
                table = table.replace_schema_metadata(metadata)
            writer = writer or open_files.enter_context(
                pq.ParquetWriter(
                    new,
                    table.schema,
                    compression="zstd",
                    use_dictionary=False,
                    use_byte_stream_split=[_leaf(table.schema.field(name)) for name in split],
                    write_page_checksum=True,
                )
            )
            writer.write_table(table, row_group_size=max(len(table), 1))


def _leaf(field: pa.Field) -> str:
    """Parquet's name of a column, or of what its lists hold."""
    return f"{field.name}.list.element" if pa.types.is_fixed_size_list(field.type) else field.name


def _to_arrow(values: np.ndarray) -> pa.Array:
    if values.ndim == 1:
        return pa.array(values)
    width = int(np.prod(values.shape[1:]))
    if values.dtype == np.uint8:
        return pa.Array.from_buffers(pa.binary(width), len(values), [None, pa.py_buffer(values)])
    return pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), width)


def read_about(path: Path) -> dict[str, Any]:
    """Read the values that `write_blocks` kept about a file.

    Raises:
        InputError: there are none, or the file is damaged.
    """
    with _errors_of(path):
        return parse_json(pq.read_schema(path).metadata[_ABOUT_KEY])


def column_names(path: Path) -> list[str]:
    """Names of the columns of a file.

    Raises:
        InputError: the file is missing or damaged.
    """
    with _errors_of(path):
        return pq.read_schema(path).names


def count_rows(path: Path) -> int:
    """Number of rows of a file.

    Raises:
        InputError: the file is missing or damaged.
    """
    with _errors_of(path):
        return pq.read_metadata(path).num_rows


def read_columns(
    path: Path, shapes: Mapping[str, tuple[int, ...]], version: int | None = None
) -> dict[str, np.ndarray]:
    """Read whole columns back as arrays; arguments and errors of `read_blocks`."""
    blocks = list(read_blocks(path, shapes, version))
    return {name: np.concatenate([block[name] for block in blocks]) for name in shapes}


def read_blocks(
    path: Path, shapes: Mapping[str, tuple[int, ...]], version: int | None = None
) -> Iterator[dict[str, np.ndarray]]:
    """Read columns back row group by row group, which bounds the memory needed.

    Args:
        path: a file of `write_blocks`.
        shapes: wanted columns and their trailing axes, () for plain ones, (-1,) for any width.
        version: what the file must have been written with.

    Raises:
        InputError: the file is damaged or of another version, or a column is missing, not of
            numbers or of another shape; it names file and field.
    """
    with _errors_of(path), pq.ParquetFile(path, page_checksum_verification=True) as file:
        schema = file.schema_arrow
        stored = (schema.metadata or {}).get(_VERSION_KEY, b"none").decode()
        if version is not None and stored != str(version):
            raise InputError(path, "schema", f"version {stored}, expected {version}", _REMEDY)
        row_bytes = sum(_row_bytes(path, schema, name, shape) for name, shape in shapes.items())
        largest = max(_LARGEST_BYTES, _DENSEST * path.stat().st_size)
        for group in range(file.num_row_groups):
            rows = file.metadata.row_group(group).num_rows
            if rows * row_bytes > largest:
                problem = f"{rows} rows of {row_bytes} bytes, but at most {largest} bytes are decoded at once"
                raise InputError(path, "file", problem, _REMEDY)
            table = file.read_row_group(group, columns=list(shapes))
            yield {name: _to_numpy(path, name, table[name], shape) for name, shape in shapes.items()}


def _errors_of(path: Path) -> AbstractContextManager[None]:
    return translate_errors(partial(InputError, path, "file", remedy=_REMEDY))


def _row_bytes(path: Path, schema: pa.Schema, name: str, shape: tuple[int, ...]) -> int:
    """Bytes of a column per row; only numbers, and lists and bytes of fixed length, are decoded."""
    if name not in schema.names:
        raise InputError(path, f"column {name}", "it is missing", _REMEDY)
    kind = schema.field(name).type
    value, width = _value_and_width(kind)
    if np.dtype(value).kind not in "biuf" or (shape != (-1,) and math.prod(shape) != width):
        problem = f"{kind}, not numbers of shape {shape} in each row"
        raise InputError(path, f"column {name}", problem, _REMEDY)
    return width * np.dtype(value).itemsize


def _value_and_width(kind: pa.DataType) -> tuple[Any, int]:
    """Type of the values of a column, and their number in each row."""
    if pa.types.is_fixed_size_binary(kind):
        return np.uint8, kind.byte_width
    value, width = (kind.value_type, kind.list_size) if pa.types.is_fixed_size_list(kind) else (kind, 1)
    return (object if pa.types.is_nested(value) else value.to_pandas_dtype()), width


def _to_numpy(path: Path, name: str, values: pa.ChunkedArray, shape: tuple[int, ...]) -> np.ndarray:
    if values.null_count:
        raise InputError(path, f"column {name}", f"{values.null_count} values are missing", _REMEDY)
    column = values.combine_chunks()
    _, width = _value_and_width(column.type)
    if pa.types.is_fixed_size_binary(column.type):
        rows = len(column)
        flat = np.frombuffer(column.buffers()[1] or b"", np.uint8, rows * width, column.offset * width)
    else:
        numbers = column.flatten() if pa.types.is_fixed_size_list(column.type) else column
        flat = numbers.to_numpy(zero_copy_only=False)
    return flat.reshape(len(column), *((width,) if shape == (-1,) else shape))
