"""Damage to files: random, reproducible mutations of their bytes."""

import io
import json
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml

NUMBERS = (
    *(b"0", b"-1", b"1e308", b"-1e308", b"1e-320", b"1e999", b"nan", b"-inf", b"9" * 40, b"9" * 5000, b"0.5"),
    *(b"1000000000", b"4294967295", b"9223372036854775807", b"-9223372036854775808", b"1_0", b"0x10", b""),
)
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 10**9, 10**400, -(10**18), 0.5, -0.0, 1e308, float("nan"), float("inf")),
    *("", "a", "../../secret", "/dev/zero", "\0", "9" * 10_000),
    *([], [[]], {}, [1] * 1000, {"a": {"b": [None]}}),
)
Mutation = Callable[[bytes, np.random.Generator], bytes]
_EDGES = (0x00, 0x01, 0x7F, 0x80, 0xFE, 0xFF)
_NUMBER = re.compile(rb"-?\d[\d.eE+-]*")
_LONGEST = 64


def flip(raw: bytes, rng: np.random.Generator) -> bytes:
    """Flip one to four bits."""
    changed = bytearray(raw)
    for place in rng.integers(0, max(len(raw), 1), rng.integers(1, 5)) if raw else ():
        changed[place] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def overwrite(raw: bytes, rng: np.random.Generator) -> bytes:
    """Overwrite a few bytes with extreme values, which damages lengths and counts."""
    start, length = int(rng.integers(0, len(raw) + 1)), int(rng.choice([1, 2, 4, 8]))
    return raw[:start] + bytes([int(rng.choice(_EDGES))]) * length + raw[start + length :]


def truncate(raw: bytes, rng: np.random.Generator) -> bytes:
    """Remove the end."""
    return raw[: int(rng.integers(0, len(raw) + 1))]


def cut(raw: bytes, rng: np.random.Generator) -> bytes:
    """Remove a piece in the middle."""
    start, length = int(rng.integers(0, len(raw) + 1)), int(rng.integers(1, _LONGEST))
    return raw[:start] + raw[start + length :]


def insert(raw: bytes, rng: np.random.Generator) -> bytes:
    """Insert random bytes."""
    start = int(rng.integers(0, len(raw) + 1))
    return raw[:start] + rng.bytes(int(rng.integers(1, _LONGEST))) + raw[start:]


def repeat(raw: bytes, rng: np.random.Generator) -> bytes:
    """Repeat a piece."""
    start, length = int(rng.integers(0, len(raw) + 1)), int(rng.integers(1, _LONGEST))
    return raw[:start] + raw[start : start + length] * int(rng.integers(2, 50)) + raw[start + length :]


def swap(raw: bytes, rng: np.random.Generator) -> bytes:
    """Swap two adjacent pieces."""
    first, second, third = np.sort(rng.integers(0, len(raw) + 1, 3)).tolist()
    return raw[:first] + raw[second:third] + raw[first:second] + raw[third:]


def number(raw: bytes, rng: np.random.Generator) -> bytes:
    """Replace a number in a text."""
    found = list(_NUMBER.finditer(raw))
    if not found:
        return flip(raw, rng)
    at = found[int(rng.integers(len(found)))]
    return raw[: at.start()] + NUMBERS[int(rng.integers(len(NUMBERS)))] + raw[at.end() :]


BYTES: tuple[Mutation, ...] = (flip, overwrite, truncate, cut, insert, repeat, swap, number)  # of any file


def _places(node: Any) -> list[tuple[Any, Any]]:
    """List every (container, key) of nested dictionaries and lists."""
    pairs = list(node.items()) if isinstance(node, dict) else list(enumerate(node))
    return [
        place
        for key, value in pairs
        for place in [(node, key), *(_places(value) if isinstance(value, dict | list) else [])]
    ]


def field(content: Any, rng: np.random.Generator) -> Any:
    """Remove, rename or change one field of a tree, or give it another field's value."""
    places = _places(content)
    node, key = places[int(rng.integers(len(places)))]
    what = int(rng.integers(5))
    if what == 0:
        del node[key]
    elif what == 1 and isinstance(node, dict):
        node[f"{key}x"] = node.pop(key)
    elif what == 2:
        other, name = places[int(rng.integers(len(places)))]
        node[key] = json.loads(json.dumps(other[name]))
    else:
        node[key] = VALUES[int(rng.integers(len(VALUES)))]
    return content


def json_field(raw: bytes, rng: np.random.Generator) -> bytes:
    return json.dumps(field(json.loads(raw), rng)).encode()


def json_lines(raw: bytes, rng: np.random.Generator) -> bytes:
    """Apply `field` to the object in one line."""
    lines = raw.splitlines(keepends=True)
    line = int(rng.integers(len(lines)))
    return b"".join([*lines[:line], json_field(lines[line], rng) + b"\n", *lines[line + 1 :]])


def table_row(raw: bytes, rng: np.random.Generator) -> bytes:
    """Remove, repeat or change a field of one line, whatever separates them."""
    lines = raw.splitlines()
    line = int(rng.integers(len(lines)))
    separator = next((mark for mark in (b";", b"\t", b",") if mark in lines[line]), b" ")
    fields = lines[line].split(separator)
    place, what = int(rng.integers(len(fields))), int(rng.integers(3))
    changed = ([], fields[place : place + 1] * 2, [NUMBERS[int(rng.integers(len(NUMBERS)))]])[what]
    lines[line] = separator.join([*fields[:place], *changed, *fields[place + 1 :]])
    return b"\n".join(lines)


def yaml_field(raw: bytes, rng: np.random.Generator) -> bytes:
    return yaml.safe_dump(field(yaml.safe_load(raw), rng)).encode()


def safetensors_field(raw: bytes, rng: np.random.Generator) -> bytes:
    """Apply `field` to the header of a safetensors file, which holds the tensors' offsets."""
    size = int.from_bytes(raw[:8], "little")
    header = json_field(raw[8 : 8 + size], rng)
    return len(header).to_bytes(8, "little") + header + raw[8 + size :]


def parquet_column(raw: bytes, rng: np.random.Generator) -> bytes:
    """Remove, rename or replace one column of a table, or drop rows."""
    table = pq.read_table(io.BytesIO(raw))
    index, rows = int(rng.integers(table.num_columns)), len(table)
    name = table.column_names[index]
    replaced: tuple[Callable[[], pa.Array], ...] = (
        lambda: pa.array([None] * rows, pa.float64()),
        lambda: pa.array(["a"] * rows),
        lambda: pa.array([b"abc"] * rows, pa.binary(3)),
        lambda: pa.array([[1.0, 2.0]] * rows),
        lambda: pa.array([1e308, -1e308, np.nan, np.inf][: max(rows, 0)] * rows)[:rows],
        lambda: pa.array(rng.integers(-(2**62), 2**62, rows)),
        lambda: pa.array([2**64 - 1] * rows, pa.uint64()),
        lambda: pa.array([0] * rows, pa.timestamp("ns")),
        lambda: pa.array([True] * rows),
        lambda: pa.nulls(rows),
    )
    what = int(rng.integers(len(replaced) + 3))
    if what == len(replaced):
        table = table.drop_columns([name])
    elif what == len(replaced) + 1:
        names = list(table.column_names)
        names[index] = str(rng.choice([names[0], f"{name}x", ""]))
        table = table.rename_columns(names)
    elif what == len(replaced) + 2:
        table = table.slice(0, int(rng.integers(rows)))
    else:
        table = table.set_column(index, name, replaced[what]())
    out = io.BytesIO()
    pq.write_table(table, out)
    return out.getvalue()


# Mutations that keep a file well-formed, by its extension
STRUCTURED: dict[str, Mutation] = {
    "json": json_field,
    "yaml": yaml_field,
    "ndjson": json_lines,
    "csv": table_row,
    "tsv": table_row,
    "txt": table_row,
    "safetensors": safetensors_field,
    "parquet": parquet_column,
}


def mutate(raw: bytes, name: str, rng: np.random.Generator) -> bytes:
    """Damage a file: half of the time its fields, if it has a known structure, otherwise its bytes."""
    structured = STRUCTURED.get(name.rpartition(".")[2])
    if structured and rng.random() < 0.5:
        return structured(raw, rng)
    for _ in range(int(rng.choice([1, 1, 1, 2, 4]))):
        raw = BYTES[int(rng.integers(len(BYTES)))](raw, rng)
    return raw
