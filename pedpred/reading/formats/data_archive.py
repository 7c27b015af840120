"""HDF5 files of the Pedestrian Dynamics Data Archive: data set `trajectory` with `fps`, ground as WKT.

    GROUP "/" { ATTRIBUTE "wkt_geometry"
                DATASET "trajectory" { COMPOUND { id, frame, x, y, z }  ATTRIBUTE "fps" } }

Those that JuPedSim writes itself have the same (schema version 1), or a time step and regions (version 2).
Damaged files make the HDF5 library hang or end the process, so that a process of its own reads them; it is
started as a command, since multiprocessing would import the caller's script once more.
"""

from __future__ import annotations

import os
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from pedpred.reading.errors import ContentError
from pedpred.reading.geometry import parse_wkt
from pedpred.reading.head import Head
from pedpred.reading.options import ReadOptions
from pedpred.reading.table import Table
from pedpred.reading.text import whole_numbers
from pedpred.storage.tracks import MOST_NUMBERS

if TYPE_CHECKING:
    import h5py

NAME = "Pedestrian Dynamics Data Archive"
_COLUMNS = ("id", "frame", "x", "y")
_LONGEST_S, _MOST_BYTES, _MOST_REGIONS = 120.0, 8 * 2**30, 1000
_SCHEMAS = (1, 2)
"""Versions of JuPedSim's own HDF5 files; those of the archive have none."""
_OTHERS = "Read are those of the Pedestrian Dynamics Data Archive; save other tables as CSV"


def recognises(head: Head) -> bool:
    """Whether a file is HDF5."""
    return head.raw.startswith(b"\x89HDF\r\n\x1a\n")


def read(path: Path, options: ReadOptions) -> Table:
    """Read the detections, and what reads the ground where people walk.

    Raises:
        ContentError: the file is damaged, of another program, or its values are wrong; h5py is not installed.
    """
    command = [sys.executable, "-c", f"from {__name__} import main; main()", str(path.absolute())]
    # Plug-ins for compression are code: none is loaded.
    environment = os.environ | {"HDF5_PLUGIN_PRELOAD": "::", "HDF5_USE_FILE_LOCKING": "FALSE"}
    environment |= {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    try:
        ended = subprocess.run(command, env=environment, capture_output=True, timeout=_LONGEST_S)
    except subprocess.TimeoutExpired as cause:
        raise ContentError(f"a damaged file of HDF5: it was not read within {_LONGEST_S:g} s") from cause
    if ended.returncode:
        lines = ended.stderr.decode(errors="replace").strip().splitlines()
        known = ended.returncode == 2 and lines
        reason = lines[-1] if known else f"a damaged file, the reader ended with exit code {ended.returncode}"
        raise ContentError(f"HDF5: {reason}", _OTHERS)
    with pa.ipc.open_stream(ended.stdout) as stream:
        table, about = stream.read_all(), stream.schema.metadata
    if not table.num_rows:
        raise ContentError("no detections, trajectory is empty")
    columns = {name: table[name].to_numpy().astype(np.float64) for name in _COLUMNS}
    columns |= {name: whole_numbers(columns[name], name) for name in ("id", "frame")}
    fps, wkt = about[b"fps"].decode(), about[b"wkt"].decode()
    walls = partial(parse_wkt, wkt) if wkt.strip() else None
    return Table(pa.table(columns), "m", float(fps) if fps else None, walls=walls)


def main() -> None:
    """Write the columns of a file, `fps` and `wkt` to stdout; or a problem to stderr, with exit code 2."""
    if sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (_MOST_BYTES, _MOST_BYTES))
    try:
        table = _content(Path(sys.argv[1]))
        with pa.ipc.new_stream(sys.stdout.buffer, table.schema) as stream:
            stream.write_table(table)
    except ImportError:
        sys.stderr.write('h5py is not installed: pip install "pedpred[hdf5]"\n')
        sys.exit(2)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, MemoryError) as problem:
        lines = str(problem).splitlines()
        sys.stderr.write(f"{lines[0][:400] if lines else type(problem).__name__}\n")
        sys.exit(2)


def _content(path: Path) -> pa.Table:
    import h5py  # heavy, and for these files alone

    with h5py.File(path, "r") as file:
        schema = file.attrs.get("schema_version")
        if schema is not None and schema not in _SCHEMAS:
            known = ", ".join(map(str, _SCHEMAS))
            raise ValueError(f"schema_version {schema} of JuPedSim is not known, only {known}")
        table = _own(file, "trajectory")
        columns = _columns(table)
        rate = table.attrs.get("fps", file.attrs.get("fps", ()))
        texts = []
        if schema == 2:
            rate = 1 / (float(file.attrs["dt"]) * float(file.attrs["every_nth_frame"]))
            texts = _own(file, "regions").fields("wkt")[:_MOST_REGIONS]
        elif schema == 1 and "geometry" in file:
            texts = _own(file, "geometry", "wkt")[:_MOST_REGIONS]
        geometry = file.attrs.get("wkt_geometry", "")
        wkt = geometry.decode() if isinstance(geometry, bytes) else str(geometry)
        wkt = "\n".join(text.decode() for text in texts) or wkt
    fps = np.ravel(np.asarray(rate, dtype=np.float64))[:1].tolist()
    return pa.table(columns).replace_schema_metadata({"fps": "".join(map(repr, fps)), "wkt": wkt})


def _columns(table: h5py.Dataset) -> dict[str, np.ndarray]:
    """The columns of `_COLUMNS`, as numbers of this machine.

    Raises:
        ValueError: it is no table, has too many rows, holds no numbers, or its compression is unknown.
    """
    import h5py  # see above

    names = table.dtype.names or ()
    if missing := [name for name in _COLUMNS if name not in names]:
        raise ValueError(f"'trajectory' has no column {missing[0]}; it has {', '.join(names)[:200]}")
    filters = table.id.get_create_plist()
    for number in range(filters.get_nfilters()):
        code, *_, name = filters.get_filter(number)
        if not h5py.h5z.filter_avail(code):
            what = f"the data are compressed with {name.decode() or 'a filter'} ({code}), which is not read"
            raise ValueError(f"{what}: bring them to gzip with h5repack -f GZIP=4, or write SQLite")
    if table.ndim != 1:
        raise ValueError(f"'trajectory' has the shape {table.shape}, it must be a list of rows")
    if table.size > MOST_NUMBERS // len(_COLUMNS):
        raise ValueError(
            f"'trajectory' has {table.size} rows, at most {MOST_NUMBERS // len(_COLUMNS)} are read"
        )
    columns = {name: np.asarray(table.fields(name)[:]) for name in _COLUMNS}
    for name, values in columns.items():
        if values.dtype.kind not in "iuf" or values.ndim != 1:
            raise ValueError(f"column {name} has the type {values.dtype}, which is not a number")
        columns[name] = values.astype(values.dtype.newbyteorder("="), copy=False)
    return columns


def _own(file: h5py.File, *names: str) -> h5py.Dataset:
    """The data set under some names, one within the other, which lies in this file.

    Raises:
        ValueError: there is none, or its data lie in another file.
    """
    import h5py  # see above

    found = file
    for name in names:
        if not isinstance(found, h5py.Group) or not isinstance(found.get(name, getlink=True), h5py.HardLink):
            raise ValueError(f"no data set {'/'.join(names)!r}; there is {', '.join(map(str, file))[:200]}")
        found = found[name]
    if not isinstance(found, h5py.Dataset):
        raise ValueError(f"{'/'.join(names)!r} is no data set")
    if found.external or found.is_virtual:
        raise ValueError("the data lie in another file")
    return found
