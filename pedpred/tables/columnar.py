"""Tables of Parquet and Arrow (Feather), as the lines of the same tables in CSV."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from itertools import count
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from pedpred.errors import SourceError
from pedpred.files import translate_errors

_PARQUET, _ARROW = b"PAR1", b"ARROW1"
_BLOCK_ROWS = 2**14
_DAMAGED = "Write the file again"


def is_columnar(path: Path) -> bool:
    """Whether a file begins as Parquet or Arrow do; not if it is missing."""
    return path.is_file() and _begin_of(path).startswith((_PARQUET, _ARROW))


def columnar_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Number (from 1) and content of the lines of the same table in CSV, titles first; words are quoted.

    Columns of lists and of bytes have a title and no values. Missing values are empty.

    Raises:
        SourceError: the file is damaged.
    """
    with translate_errors(partial(SourceError, path, None, remedy=_DAMAGED)):
        titles, blocks = _arrow(path) if _begin_of(path) == _ARROW else _parquet(path)
        numbers = count(1)
        yield next(numbers), ",".join(_field(title) for title in titles)
        for block in blocks:
            columns = [_texts(block, title) for title in titles]
            for fields in zip(*columns, strict=True):
                yield next(numbers), ",".join(fields)


def _begin_of(path: Path) -> bytes:
    with translate_errors(partial(SourceError, path, None)), path.open("rb") as file:
        return file.read(len(_ARROW))


def _parquet(path: Path) -> tuple[list[str], Iterator[pa.RecordBatch]]:
    file = pq.ParquetFile(path)
    plain = [field.name for field in file.schema_arrow if _is_plain(field.type)]
    return file.schema_arrow.names, file.iter_batches(_BLOCK_ROWS, columns=plain)


def _arrow(path: Path) -> tuple[list[str], Iterable[pa.RecordBatch]]:
    file = pa.ipc.open_file(path)
    return file.schema.names, (file.get_batch(at) for at in range(file.num_record_batches))


def _is_plain(kind: pa.DataType) -> bool:
    return not (pa.types.is_nested(kind) or pa.types.is_binary(kind) or pa.types.is_large_binary(kind))


def _texts(block: pa.RecordBatch, title: str) -> list[str]:
    """Values of a column as fields."""
    at = block.schema.get_field_index(title)
    if at < 0 or not _is_plain(block.schema.field(at).type):
        return [""] * len(block)
    return [_field(value) for value in block.column(at).to_pylist()]


def _field(value: object) -> str:
    """A value as a field of CSV."""
    if value is None:
        return ""
    if isinstance(value, str):
        return '"' + " ".join(value.replace('"', '""').splitlines()) + '"'
    return str(value)
