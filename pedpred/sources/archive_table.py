"""Writes the table of an archive (HDF5) to stdout as plain numbers: `python archive_table.py IN ROWS`.

A process of its own: the HDF5 library trusts what it reads, and damaged files make it hang or end the
process. It ends with exit code 2 and one line on stderr if the file is not as it should be.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

if TYPE_CHECKING:
    import h5py

COLUMNS = ("id", "frame", "x", "y")
_MOST_BYTES = 8 * 2**30
_SCHEMAS = (1, 2)
"""Versions of JuPedSim's own HDF5 files; those of the archive have none."""
_MOST_REGIONS = 1000


def copy_table(archive: Path, out: BinaryIO, most_rows: int) -> None:
    """Copy the columns of the data set `trajectory`, its `fps` and the file's `wkt_geometry`.

    Version 2 of JuPedSim's own files has the time step and how many of them a frame has in place of `fps`,
    and regions; version 1 has a list of geometries where these change.

    Args:
        archive: of the Pedestrian Dynamics Data Archive, or of JuPedSim.
        out: gets a line of JSON with `fps` and `wkt`, empty if unknown, the number of `rows` and the `types`
            of the columns by name; then the columns, one after the other.
        most_rows: of the table.

    Raises:
        ValueError: the table is not there, or lies in another file.
    """
    import h5py  # heavy, and for these files alone

    with h5py.File(archive, "r") as file:
        schema = file.attrs.get("schema_version")
        if schema is not None and schema not in _SCHEMAS:
            known = ", ".join(map(str, _SCHEMAS))
            raise ValueError(f"schema_version {schema} of JuPedSim is not known, only {known}")
        texts = []
        if schema == 2:
            texts = _own(file, "regions").fields("wkt")[:_MOST_REGIONS]
        elif schema == 1 and "geometry" in file:
            texts = _own(file, "geometry", "wkt")[:_MOST_REGIONS]
        table = _own(file, "trajectory")
        names = table.dtype.names or ()
        for name in COLUMNS:
            if name not in names:
                raise ValueError(f"'trajectory' has no column {name}; it has {', '.join(names)[:200]}")
        filters = table.id.get_create_plist()
        for number in range(filters.get_nfilters()):
            code, *_, name = filters.get_filter(number)
            if not h5py.h5z.filter_avail(code):
                what = (
                    f"the data are compressed with {name.decode() or 'a filter'} ({code}), which is not read"
                )
                raise ValueError(f"{what}: bring them to gzip with h5repack -f GZIP=4, or write SQLite")
        columns = _columns(table, most_rows)
        said = table.attrs.get("fps", file.attrs.get("fps", ()))
        if schema == 2:
            said = 1 / (float(file.attrs["dt"]) * float(file.attrs["every_nth_frame"]))
        fps = np.ravel(np.asarray(said, dtype=np.float64))[:1].tolist()
        geometry = file.attrs.get("wkt_geometry", "")
        wkt = geometry.decode() if isinstance(geometry, bytes) else str(geometry)
        wkt = "\n".join(text.decode() for text in texts) or wkt
    about: dict[str, Any] = {"fps": "".join(map(repr, fps)), "wkt": wkt, "rows": table.size}
    about["types"] = {name: values.dtype.str for name, values in columns.items()}
    out.write(json.dumps(about, ensure_ascii=False).encode() + b"\n")
    for values in columns.values():
        out.write(np.ascontiguousarray(values).data)
    out.flush()


def _columns(table: h5py.Dataset, most_rows: int) -> dict[str, np.ndarray]:
    """The columns of `COLUMNS`, as numbers of this machine.

    Raises:
        ValueError: the table is none, has too many rows, or a column holds no numbers.
    """
    if table.ndim != 1:
        raise ValueError(f"'trajectory' has the shape {table.shape}, it must be a list of rows")
    if table.size > most_rows:
        raise ValueError(f"'trajectory' has {table.size} rows, more than {most_rows} rows are not read")
    columns = {name: np.asarray(table.fields(name)[:]) for name in COLUMNS}
    for name, values in columns.items():
        if values.dtype.kind not in "iuf":
            raise ValueError(f"column {name} has the type {values.dtype}, which is not a number")
        if values.ndim != 1:
            raise ValueError(f"column {name} has the shape {values.shape}, it must be a list of numbers")
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


def main() -> None:
    """Copy with bounded memory, or say why not."""
    if sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (_MOST_BYTES, _MOST_BYTES))
    try:
        copy_table(Path(sys.argv[1]), sys.stdout.buffer, int(sys.argv[2]))
    except ImportError:
        sys.exit('h5py is not installed: pip install "pedpred[hdf5]"')
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, MemoryError) as problem:
        said = str(problem).splitlines()
        sys.stderr.write(f"{said[0][:400] if said else type(problem).__name__}\n")
        sys.exit(2)


if __name__ == "__main__":
    main()
