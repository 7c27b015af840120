"""Tables of Parquet and Arrow (Feather), as the lines of the same tables in CSV."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from itertools import count
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from pedpred.errors import SourceError
from pedpred.files import translate_errors

_PARQUET, _ARROW = b"PAR1", b"ARROW1"
_BLOCK_ROWS = 2**14
_DAMAGED = "Write the file again"
_DEEPEST = 4

_Leaf = tuple[tuple[str, ...], pa.DataType]
"""Names that lead to the values of a column, through the structures in which they are, and their type."""


def is_columnar(path: Path) -> bool:
    """Whether a file begins as Parquet or Arrow do; not if it is missing."""
    return path.is_file() and _begin_of(path).startswith((_PARQUET, _ARROW))


def columnar_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Number (from 1) and content of the lines of the same table in CSV, titles first; words are quoted.

    Values in structures are columns of their own, called `position.x`. Columns of lists and of bytes have a
    title and no values. Missing values are empty.

    Raises:
        SourceError: the file is damaged.
    """
    with translate_errors(partial(SourceError, path, None, remedy=_DAMAGED)):
        leaves, blocks = _arrow(path) if _begin_of(path) == _ARROW else _parquet(path)
        numbers = count(1)
        yield next(numbers), ",".join(_field(".".join(names)) for names, _ in leaves)
        for block in blocks:
            columns = [_texts(block, names, kind) for names, kind in leaves]
            for fields in zip(*columns, strict=True):
                yield next(numbers), ",".join(fields)


def _begin_of(path: Path) -> bytes:
    with translate_errors(partial(SourceError, path, None)), path.open("rb") as file:
        return file.read(len(_ARROW))


def _parquet(path: Path) -> tuple[list[_Leaf], Iterator[pa.RecordBatch]]:
    file = pq.ParquetFile(path)
    leaves = list(_leaves(file.schema_arrow))
    plain = [".".join(names) for names, kind in leaves if _is_plain(kind)]
    return leaves, file.iter_batches(_BLOCK_ROWS, columns=plain)


def _arrow(path: Path) -> tuple[list[_Leaf], Iterable[pa.RecordBatch]]:
    file = pa.ipc.open_file(path)
    return list(_leaves(file.schema)), (file.get_batch(at) for at in range(file.num_record_batches))


def _leaves(fields: Iterable[pa.Field], above: tuple[str, ...] = ()) -> Iterator[_Leaf]:
    """Columns, and those in structures, with the types of their values."""
    for field in fields:
        names = (*above, field.name)
        if pa.types.is_struct(field.type) and len(names) < _DEEPEST:
            yield from _leaves((field.type.field(at) for at in range(field.type.num_fields)), names)
        else:
            yield names, field.type


def _is_plain(kind: pa.DataType) -> bool:
    return not (pa.types.is_nested(kind) or pa.types.is_binary(kind) or pa.types.is_large_binary(kind))


def _texts(block: pa.RecordBatch, names: tuple[str, ...], kind: pa.DataType) -> list[str]:
    """Values of a column as fields; empty ones where a name is there several times."""
    at = block.schema.get_field_index(names[0])
    if at < 0 or not _is_plain(kind):
        return [""] * len(block)
    column = block.column(at)
    for name in names[1:]:
        if (at := column.type.get_field_index(name)) < 0:
            return [""] * len(block)
        column = pc.struct_field(column, [at])
    return [_field(value) for value in column.to_pylist()]


def _field(value: object) -> str:
    """A value as a field of CSV."""
    if value is None:
        return ""
    if isinstance(value, str):
        return '"' + " ".join(value.replace('"', '""').splitlines()) + '"'
    return str(value)
