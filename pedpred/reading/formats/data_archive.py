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
from pedpred.reading.text import check_size

if TYPE_CHECKING:
    import h5py

NAME = "Pedestrian Dynamics Data Archive"
_COLUMNS = ("id", "frame", "x", "y")
_LONGEST_S, _MOST_BYTES, _MOST_REGIONS = 120.0, 8 * 2**30, 1000
_SCHEMAS = (None, 1, 2)
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
        reason = lines[-1] if lines else f"the reader ended with exit code {ended.returncode}"
        raise ContentError(f"HDF5: {reason[:400]}", _OTHERS)
    with pa.ipc.open_stream(ended.stdout) as stream:
        rows, about = stream.read_all(), stream.schema.metadata
    fps, wkt = about[b"fps"].decode(), about[b"wkt"].decode()
    walls = partial(parse_wkt, wkt) if wkt.strip() else None
    return Table(rows, "m", float(fps) if fps else None, walls=walls)


def main() -> None:
    """Write the columns of a file, `fps` and `wkt` to stdout; or a problem as the last line of stderr."""
    if sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (_MOST_BYTES, _MOST_BYTES))
    try:
        table = _content(Path(sys.argv[1]))
        with pa.ipc.new_stream(sys.stdout.buffer, table.schema) as stream:
            stream.write_table(table)
    except ImportError:
        sys.exit('h5py is not installed: pip install "pedpred[hdf5]"')
    except Exception as problem:  # whatever h5py raises on damaged bytes
        sys.exit(" ".join(str(problem).split()) or type(problem).__name__)


def _content(path: Path) -> pa.Table:
    import h5py  # heavy, and for these files alone

    with h5py.File(path, "r") as file:
        schema = file.attrs.get("schema_version")
        if schema not in _SCHEMAS:
            raise ContentError(f"schema_version {schema} of JuPedSim is not known, only 1, 2")
        table = _own(file, "trajectory")
        if missing := [name for name in _COLUMNS if name not in (table.dtype.names or ())]:
            raise ContentError(f"'trajectory' has no column {missing[0]}; it has {table.dtype.names}"[:300])
        filters = table.id.get_create_plist()
        codes = [filters.get_filter(number)[0] for number in range(filters.get_nfilters())]
        if not all(map(h5py.h5z.filter_avail, codes)):
            problem = f"the compression of the data (HDF5 filters {codes}) is not installed"
            raise ContentError(f"{problem}: bring them to gzip with h5repack -f GZIP=4, or write SQLite")
        check_size(table.size)
        columns = {name: np.ravel(table.fields(name)[:]).astype(np.float64) for name in _COLUMNS}
        fps = table.attrs.get("fps", file.attrs.get("fps", ()))
        wkt = [file.attrs.get("wkt_geometry", "")]
        if schema == 2:
            fps = 1 / (float(file.attrs["dt"]) * float(file.attrs["every_nth_frame"]))
            wkt = _own(file, "regions").fields("wkt")[:_MOST_REGIONS]
        elif schema == 1 and "geometry" in file:
            wkt = _own(file, "geometry/wkt")[:_MOST_REGIONS]
        texts = [text.decode() if isinstance(text, bytes) else str(text) for text in wkt]
    rate = np.ravel(np.asarray(fps, np.float64))[:1].tolist()
    about = {"fps": "".join(map(repr, rate)), "wkt": "\n".join(texts)}
    return pa.table(columns).replace_schema_metadata(about)


def _own(file: h5py.File, path: str) -> h5py.Dataset:
    """The data set at a path, whose data lie in this file.

    Raises:
        ContentError: there is none, or its data lie in another file.
    """
    import h5py  # see above

    parts = path.split("/")
    links = [file.get("/".join(parts[: end + 1]), getlink=True) for end in range(len(parts))]
    if not all(isinstance(link, h5py.HardLink) for link in links) or not isinstance(file[path], h5py.Dataset):
        raise ContentError(f"no data set {path!r} in this file; there is {', '.join(map(str, file))[:200]}")
    found = file[path]
    if found.external or found.is_virtual:
        raise ContentError("the data lie in another file")
    return found
