"""Copies the table of an archive (HDF5) to Parquet: `python archive_table.py IN OUT ROWS`.

A process of its own: the HDF5 library trusts what it reads, and damaged files make it hang or end the
process. It ends with exit code 2 and one line on stderr if the file is not as it should be.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

COLUMNS = ("id", "frame", "x", "y")
_MOST_BYTES = 8 * 2**30


def copy_table(archive: Path, out: Path, most_rows: int) -> None:
    """Copy the columns of the data set `trajectory`, its `fps` and the file's `wkt_geometry`.

    Args:
        archive: of the Pedestrian Dynamics Data Archive.
        out: a Parquet file with these columns; `fps` and `wkt`, empty if unknown, are its metadata.
        most_rows: of the table.

    Raises:
        ValueError: the table is not there, or lies in another file.
    """
    import h5py  # heavy, and for these files alone

    with h5py.File(archive, "r") as file:
        if not isinstance(file.get("trajectory", getlink=True), h5py.HardLink):
            raise ValueError(f"no data set 'trajectory'; there is {', '.join(map(str, file))[:200]}")
        table = file["trajectory"]
        names = (isinstance(table, h5py.Dataset) and table.dtype.names) or ()
        for name in COLUMNS:
            if name not in names:
                raise ValueError(f"'trajectory' has no column {name}; it has {', '.join(names)[:200]}")
        if table.external or table.is_virtual:
            raise ValueError("the data lie in another file")
        filters = table.id.get_create_plist()
        for number in range(filters.get_nfilters()):
            code, *_, name = filters.get_filter(number)
            if not h5py.h5z.filter_avail(code):
                what = (
                    f"the data are compressed with {name.decode() or 'a filter'} ({code}), which is not read"
                )
                raise ValueError(f"{what}: bring them to gzip with h5repack -f GZIP=4, or write SQLite")
        if table.ndim != 1:
            raise ValueError(f"'trajectory' has the shape {table.shape}, it must be a list of rows")
        if table.size > most_rows:
            raise ValueError(f"'trajectory' has {table.size} rows, more than {most_rows} rows are not read")
        columns = {name: np.asarray(table.fields(name)[:]) for name in COLUMNS}
        for name, values in columns.items():
            if values.dtype.kind not in "iuf":
                raise ValueError(f"column {name} has the type {values.dtype}, which is not a number")
            columns[name] = values.astype(values.dtype.newbyteorder("="), copy=False)
        said = table.attrs.get("fps", file.attrs.get("fps", ()))
        fps = np.ravel(np.asarray(said, dtype=np.float64))[:1].tolist()
        geometry = file.attrs.get("wkt_geometry", "")
        wkt = geometry.decode() if isinstance(geometry, bytes) else str(geometry)
    about = {"fps": "".join(map(repr, fps)), "wkt": wkt}
    pq.write_table(pa.table(columns).replace_schema_metadata(about), out, compression="none")


def main() -> None:
    """Copy with bounded memory, or say why not."""
    if sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (_MOST_BYTES, _MOST_BYTES))
    try:
        copy_table(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]))
    except ImportError:
        sys.exit('h5py is not installed: pip install "pedpred[hdf5]"')
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, MemoryError) as problem:
        said = str(problem).splitlines()
        sys.stderr.write(f"{said[0][:400] if said else type(problem).__name__}\n")
        sys.exit(2)


if __name__ == "__main__":
    main()
