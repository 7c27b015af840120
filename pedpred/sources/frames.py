"""Formats that count frames: their rate, from files or options, and tracks from them."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError
from pedpred.files import translate_errors
from pedpred.scenes import Trajectories
from pedpred.storage.tracks import tracks_of
from pedpred.tables.detections import without_copies
from pedpred.tables.options import FASTEST_HZ, SLOWEST_HZ, TableOptions, is_same_rate


def agreed_rate(
    path: Path,
    said: float | None,
    options: TableOptions,
    missing: str,
    name: str = "fps",
    line: int | None = None,
) -> float:
    """Return the rate that a file says, or else the options.

    Args:
        path: of the file.
        said: by the file; None: nothing.
        options: what the user says.
        missing: what is wrong if nobody says it.
        name: under which the file says it.
        line: where it does.

    Raises:
        SourceError: nobody says it, both do and differ, or it is not a rate.
    """
    if said is None:
        if options.rate_hz is None:
            raise SourceError(path, None, missing, "Say how many frames a second has: --rate")
        return options.rate_hz
    if options.rate_hz is not None and not is_same_rate(options.rate_hz, said):
        problem = f"{name} = {said:g}, but --rate says {options.rate_hz:g}"
        raise SourceError(path, line, problem, "Leave --rate out")
    if not SLOWEST_HZ <= said <= FASTEST_HZ:
        raise SourceError(path, line, f"{name} = {said:g} is not a rate")
    return said


def tracks_in_frames(
    path: Path, columns: dict[str, np.ndarray], rate_hz: float, counted: str = "line"
) -> Trajectories:
    """Build the tracks; rows that say the same as an earlier one are left out, with a warning.

    Args:
        path: of the file.
        columns: `line`, `frame`, `track_id`, `x_m` and `y_m`. [M] each
        rate_hz: frames per second.
        counted: what `line` counts, see `without_copies`.

    Raises:
        SourceError: somebody is at two places at once, or a value is impossible.
    """
    columns = without_copies(path, columns, clock="frame", counted=counted)
    with translate_errors(partial(SourceError, path, None)):
        return tracks_of(columns | {"time_s": columns["frame"] / rate_hz}, path)
