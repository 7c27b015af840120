"""Times in seconds from milliseconds or frame numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pedpred.errors import SourceError
from pedpred.scenes.scene import LATEST_S

IN_SECONDS = "Times are seconds; call the column time_ms, or frame and give --rate"

_PARTS = {"nanoseconds": 1e9, "microseconds": 1e6}
_LONG_AGO_S = 1e8  # Unix times are later


def set_time(path: Path, columns: dict[str, np.ndarray], rate_hz: float | None) -> None:
    """Make `time_s` of milliseconds or frames."""
    if "time_ms" in columns:
        columns["time_s"] = columns.pop("time_ms") / 1000.0
    elif "frame" in columns:
        if rate_hz is None:
            remedy = "Say how many frames a second has: --rate"
            raise SourceError(path, None, "frame numbers, but no rate", remedy)
        columns["time_s"] = columns.pop("frame") / rate_hz
    largest = np.abs(columns["time_s"]).max(initial=0.0)
    if largest >= LATEST_S:
        unit = next(
            (unit for unit, parts in _PARTS.items() if largest >= _LONG_AGO_S * parts), "milliseconds"
        )
        raise SourceError(path, None, f"the time {largest:.10g} looks like {unit}", IN_SECONDS)
