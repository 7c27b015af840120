"""Checksums of what the pipeline makes, part by part.

`python -m tools.checksums FOLDER` prints one line per table, tensor or graph below a project folder that has
been reproduced; `--against FILE` compares them with the lines in a file, and fails when some differ or are
lost. Shows that a change of the code left scenes, rows, embeddings, weights, exported networks, forecasts and
metrics as they were.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from safetensors.numpy import load_file

from pedpred.errors import InputError, user_errors
from pedpred.files import translate_errors

FIGURES = "reports/metrics"
"""Folder of the metric files."""
IGNORED = r"config\.checked|data/raw|manifest\.json|about\.json|model\.json"
"""What describes results."""
_DIGITS = 16
_LINE = re.compile(rf"[0-9a-f]{{{_DIGITS}}} .+")


def checksums(root: Path) -> dict[str, str]:
    """Name -> checksum of everything that was made below a project folder.

    Raises:
        InputError: nothing was.
    """
    digests = {}
    for folder in ("data", "models", FIGURES):
        for path in sorted((root / folder).rglob("*")):
            if path.is_file():
                for part, digest in parts_of(path, figures=folder == FIGURES):
                    name = f"{path.relative_to(root)} {part}".strip()
                    if not re.search(IGNORED, name):
                        digests[name] = digest
    if not digests:
        remedy = "Name the folder of a project that has been reproduced"
        raise InputError(root, "", "there are no results below data, models and reports/metrics", remedy)
    return digests


def listed(path: Path) -> dict[str, str]:
    """Name -> checksum in the lines that an earlier call printed.

    Raises:
        InputError: they are not there, or it printed none.
    """
    wording = partial(InputError, path, remedy="Name a file with all that an earlier call printed")
    with translate_errors(partial(wording, "")):
        lines = path.read_text().splitlines()
    for number, text in enumerate(lines, 1):
        if not _LINE.fullmatch(text):
            raise wording(f", line {number}", "it is no checksum and name")
    if not lines:
        raise wording("", "it has no lines")
    return {name: digest for digest, _, name in (line.partition(" ") for line in lines)}


def parts_of(path: Path, figures: bool) -> Iterator[tuple[str, str]]:
    """Parts of a file with their checksums: columns, tensors, figures of a metric file, or the whole."""
    if path.suffix == ".parquet":
        table = pq.read_table(path)
        for name in table.column_names:
            yield name, _digest(_bytes_of(table[name].combine_chunks()))
    elif path.suffix == ".safetensors":
        for name, tensor in load_file(path).items():
            yield name, _digest(tensor.tobytes())
    elif path.suffix == ".json" and figures:
        for place, methods in json.loads(path.read_text()).items():
            by_method = methods if isinstance(methods, dict) else {"": methods}
            for method, measured in by_method.items():
                yield f"{place} {method}", _digest(json.dumps(measured, sort_keys=True).encode())
    else:
        yield "", _digest(path.read_bytes())


def _bytes_of(column: pa.Array) -> bytes:
    if pa.types.is_fixed_size_binary(column.type):
        return b"".join(column.to_pylist())
    flat = column.flatten() if pa.types.is_fixed_size_list(column.type) else column
    values: np.ndarray = flat.to_numpy(zero_copy_only=False)
    if values.dtype == object:  # texts, lists or yes and no with gaps: its bytes would be addresses
        return json.dumps(column.to_pylist(), default=repr).encode()
    return values.tobytes()


def _digest(raw: bytes) -> str:
    return hashlib.sha256(raw).hexdigest()[:_DIGITS]


@user_errors()
def main() -> None:
    """Print or compare."""
    parser = argparse.ArgumentParser(
        prog="python -m tools.checksums", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("folder", type=Path, help="project folder that has been reproduced")
    parser.add_argument("--against", type=Path, help="file with lines of an earlier call")
    options = parser.parse_args()
    now = checksums(options.folder)
    if options.against is None:
        sys.stdout.writelines(f"{digest} {name}\n" for name, digest in now.items())
        return
    before = listed(options.against)
    common = before.keys() & now.keys()
    differ = sorted(name for name in common if before[name] != now[name])
    sys.stdout.writelines(f"differs: {name}\n" for name in differ)
    sys.stdout.writelines(f"only before: {name}\n" for name in sorted(before.keys() - now.keys()))
    sys.stdout.writelines(f"only now: {name}\n" for name in sorted(now.keys() - before.keys()))
    sys.stdout.write(f"{len(common) - len(differ)} the same, {len(differ)} differ\n")
    raise SystemExit(bool(differ or before.keys() - now.keys()))


if __name__ == "__main__":
    main()
