"""Recordings in a single file of tracks: tables, laboratory texts and TrajNet++; the map is unknown."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pedpred.errors import SourceError, ValueRuleError
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.sources.jupedsim import read_tracks
from pedpred.sources.plausibility import check_speeds
from pedpred.sources.trajnet import read_ndjson
from pedpred.storage.tables import IN_SECONDS, TableOptions, has_header, read_table

_LONGEST_S = 5.0
"""Longest usual time between two detections of a pedestrian that can be seconds."""
_TOO_LONG = {5e6: "nanoseconds", 5e3: "microseconds", _LONGEST_S: "milliseconds or frame numbers"}


def read_file(path: Path, options: TableOptions | None = None) -> Scene:
    """Read the tracks in a file, on free ground; the scene is named after the file.

    Args:
        path: its suffix is one of `FORMATS`.
        options: what the file does not say itself.

    Raises:
        SourceError: the file cannot be understood, nobody is detected twice, its times are no seconds, or
            people would move at impossible speeds.
    """
    options = options or TableOptions()
    trajectories = FORMATS[path.suffix](path, options)
    try:
        dt_s = trajectories.usual_interval_s()
    except ValueRuleError as cause:
        raise SourceError(path, None, str(cause), "A track needs several detections") from cause
    check_clock(path, dt_s)
    check_speeds(path, trajectories, sure=options.unit is not None)
    return Scene(path.stem, trajectories, OccupancyMap.free_around(trajectories.position), dt_s)


def check_clock(path: Path, dt_s: float) -> None:
    """Check that the usual time between two detections of a track can be seconds.

    Raises:
        SourceError: it is too long; the message names what it looks like.
    """
    for least, unit in _TOO_LONG.items():
        if dt_s >= least:
            problem = f"a track is usually detected every {dt_s:g} s: this looks like {unit}"
            raise SourceError(path, None, problem, IN_SECONDS)


def _read_text(path: Path, options: TableOptions) -> Trajectories:
    """Read a table if it has a header or is given one, else lines of id, frame, x, y or frame, id, x, y."""
    if options.columns is not None or has_header(path):
        return read_table(path, options)
    return read_tracks(path, options.rate_hz, options.unit, any_order=True)


FORMATS: dict[str, Callable[[Path, TableOptions], Trajectories]] = {
    ".csv": read_table,
    ".tsv": read_table,
    ".txt": _read_text,
    ".ndjson": read_ndjson,
}
"""Readers by the file's suffix."""
