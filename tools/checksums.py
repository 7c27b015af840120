"""Checksums of what the pipeline makes: `python -m tools.checksums FOLDER > before.txt`.

Prints a line for each column, tensor, figure or other file below a project folder that has been reproduced.
`diff before.txt after.txt` then shows what a change of the code has changed.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from safetensors.numpy import load_file

from pedpred.errors import user_errors

FIGURES = "reports/metrics"
_ABOUT_RESULTS = re.compile(r"config\.checked|data/raw|manifest\.json|about\.json|model\.json")


def checksums(root: Path) -> Iterator[tuple[str, str]]:
    """Yield name and checksum of everything that was made below a project folder."""
    for folder in ("data", "models", FIGURES):
        for path in sorted(path for path in (root / folder).rglob("*") if path.is_file()):
            for part, content in _parts(path, figures=folder == FIGURES):
                name = f"{path.relative_to(root)} {part}".strip()
                if not _ABOUT_RESULTS.search(name):
                    yield name, hashlib.sha256(content).hexdigest()[:16]


def _parts(path: Path, figures: bool) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of columns, tensors, figures of a metric file, or the whole file."""
    if path.suffix == ".parquet":
        table = pq.read_table(path)
        yield from ((name, _column_bytes(table[name].combine_chunks())) for name in table.column_names)
    elif path.suffix == ".safetensors":
        yield from ((name, tensor.tobytes()) for name, tensor in load_file(path).items())
    elif path.suffix == ".json" and figures:
        for place, methods in json.loads(path.read_text()).items():
            by_method = methods if isinstance(methods, dict) else {"": methods}
            for method, measured in by_method.items():
                yield f"{place} {method}", json.dumps(measured, sort_keys=True).encode()
    else:
        yield "", path.read_bytes()


def _column_bytes(column: pa.Array) -> bytes:
    flat = column.flatten() if pa.types.is_fixed_size_list(column.type) else column
    if pa.types.is_fixed_size_binary(flat.type):
        return b"".join(flat.to_pylist())
    values: np.ndarray = flat.to_numpy(zero_copy_only=False)
    if values.dtype == object:  # its bytes would be addresses
        return json.dumps(column.to_pylist(), default=repr).encode()
    return values.tobytes()


@user_errors()
def main(arguments: list[str] | None = None) -> None:
    """Print the checksums."""
    parser = argparse.ArgumentParser(prog="python -m tools.checksums", description=__doc__)
    parser.add_argument("folder", type=Path, help="project folder that has been reproduced")
    options = parser.parse_args(arguments)
    sys.stdout.writelines(f"{digest} {name}\n" for name, digest in checksums(options.folder))


if __name__ == "__main__":
    main()
