"""HDF5 files of the Pedestrian Dynamics Data Archive: data set `trajectory` with `fps`, geometry as WKT.

Those that JuPedSim writes itself have the same (schema version 1), or a time step and regions (version 2).
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from pedpred.errors import SourceError
from pedpred.files import translate_errors
from pedpred.scenes import Trajectories
from pedpred.sources import archive_table
from pedpred.sources.archive_table import COLUMNS
from pedpred.sources.beginnings import Beginning
from pedpred.sources.frames import agreed_rate, tracks_in_frames
from pedpred.sources.geometry_wkt import parse_wkt
from pedpred.sources.walls import Walls
from pedpred.storage.tracks import MOST_NUMBERS
from pedpred.tables.options import TableOptions

MAGIC = b"\x89HDF\r\n\x1a\n"
_LONGEST_S = 120.0
_LARGEST_WHOLE = 2**53


def fits(begins: Beginning) -> bool:
    """Whether a file is HDF5."""
    return begins.raw.startswith(MAGIC)


def read(path: Path, options: TableOptions) -> tuple[Trajectories, Callable[[], Walls | None]]:
    """Read the detections, and what gives the ground where people walk, or None where the file has none.

    Args:
        path: the file.
        options: its `rate_hz` is used where the file has no `fps`.

    Raises:
        SourceError: the file is damaged, of another program, or its values are wrong; h5py is not installed.
            The geometry cannot be understood: when it is asked for.
    """
    columns, about = _content(path)
    whole = {name: columns[name] for name in ("id", "frame")}
    for name, values in whole.items():
        wrong = ~(np.abs(values.astype(np.float64)) <= _LARGEST_WHOLE) | (values % 1 != 0)
        for row in np.flatnonzero(wrong)[:1]:
            problem = f"row {row} of trajectory: {name} = {values[row]} is not a whole number"
            raise SourceError(path, None, problem)
    if not len(whole["id"]):
        raise SourceError(path, None, "no detections, trajectory is empty")
    said = float(about["fps"]) if about["fps"] else None
    rate_hz = agreed_rate(path, said, options, "trajectory has no fps")
    rows = {"line": np.arange(1, len(whole["id"]) + 1)}
    rows |= {"frame": whole["frame"].astype(np.int64), "track_id": whole["id"].astype(np.int64)}
    rows |= {f"{name}_m": columns[name].astype(np.float64) for name in ("x", "y")}
    return tracks_in_frames(path, rows, rate_hz, counted="row"), partial(_walls, path, about["wkt"])


def read_walls(path: Path) -> Walls | None:
    """Read the ground where people walk; None where the file has none.

    Raises:
        SourceError: the geometry cannot be understood.
    """
    return _walls(path, _content(path)[1]["wkt"])


def _walls(path: Path, wkt: str) -> Walls | None:
    return parse_wkt(path, wkt) if wkt.strip() else None


def _content(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Columns by name, and `fps` and `wkt`, as `archive_table` writes them.

    Raises:
        SourceError: it could not; the message says why.
    """
    # Filters of strangers are code: none is loaded.
    environment = os.environ | {"HDF5_PLUGIN_PRELOAD": "::", "HDF5_USE_FILE_LOCKING": "FALSE"}
    with TemporaryDirectory() as folder:
        out = Path(folder, "table")
        rows = str(MOST_NUMBERS // len(COLUMNS))
        # Run as a file: as a module of this package, it would first import all readers.
        run = f"import runpy; runpy.run_path({archive_table.__file__!r}, run_name='__main__')"
        command = [sys.executable, "-c", run, str(path.absolute()), rows]
        try:
            with out.open("wb") as file:
                ended = subprocess.run(
                    command,
                    cwd=folder,
                    env=environment,
                    stdout=file,
                    stderr=subprocess.PIPE,
                    timeout=_LONGEST_S,
                )
        except subprocess.TimeoutExpired as cause:
            problem = f"a damaged file of HDF5: it was not read within {_LONGEST_S:g} s"
            raise SourceError(path, None, problem) from cause
        if ended.returncode:
            said = ended.stderr.decode(errors="replace").strip().splitlines()
            reason = f"a damaged file, the reader ended with exit code {ended.returncode}"
            if ended.returncode in (1, 2) and said:
                reason = said[-1]
            remedy = "Read are those of the Pedestrian Dynamics Data Archive; save other tables as CSV"
            raise SourceError(path, None, f"HDF5: {reason}", remedy)
        with translate_errors(partial(SourceError, path, None)), out.open("rb") as file:
            about = json.loads(file.readline())
            columns = {name: np.fromfile(file, about["types"][name], about["rows"]) for name in COLUMNS}
    return columns, about
