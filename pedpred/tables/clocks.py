"""Times in seconds from other units or from frame numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pedpred.errors import SourceError, worded
from pedpred.scenes.scene import LATEST_S
from pedpred.tables.text import AS_TIMES
from pedpred.tables.titles import LARGER, REST
from pedpred.tables.units import PER_SECOND
from pedpred.tables.wraps import unwrapped

_PARTS = {"nanoseconds": 1e9, "microseconds": 1e6}
_DATE_DIGITS, _CENTURIES = (14, 17, 20), ("19", "20")
_LONG_AGO_S = 1e8  # Unix times are later
_PER_LARGER = 60  # minutes, and more than hours


def other_times() -> str:
    """What to do where times are no seconds."""
    rate = worded("--rate", "rate_hz")
    return f"Times are seconds; call the column time_ms, time_us or time_ns, or frame and give {rate}"


def add_rest(columns: dict[str, np.ndarray], unit: str | None) -> bool:
    """Add the second part of stamps that are whole seconds and a rest below one second.

    If the second column holds the whole times, of which the first one has the seconds, it is taken. If the
    first one has fractions, nothing is added.

    Args:
        columns: with `time_s`, s, and `rest_of_time`, which is removed.
        unit: of the rest.

    Returns:
        Whether the second column is used.
    """
    rest_s = columns.pop(REST) / PER_SECOND[unit or "s"]
    if (columns["time_s"] != np.floor(columns["time_s"])).any():
        return False
    if ((rest_s >= 0) & (rest_s < 1)).all():
        columns["time_s"] = columns["time_s"] + rest_s
    elif (np.abs(rest_s - columns["time_s"]) < 1).all():
        columns["time_s"] = rest_s
    else:
        return False
    return True


def add_larger(columns: dict[str, np.ndarray]) -> bool:
    """Add minutes and hours to seconds that begin again with each of them.

    Args:
        columns: with `time_s`, s, and `minute`, perhaps `hour`, which are removed.

    Returns:
        Whether they are used: not where seconds go on beyond a minute.
    """
    parts = {name: columns.pop(name) for name in LARGER if name in columns}
    whole = [(part >= 0) & (part < _PER_LARGER) & (part == np.floor(part)) for part in parts.values()]
    begins = (columns["time_s"] >= 0) & (columns["time_s"] < LARGER["minute"])
    if "minute" not in parts or not np.logical_and.reduce([begins, *whole]).all():
        return False
    columns["time_s"] = columns["time_s"] + sum(LARGER[name] * part for name, part in parts.items())
    return True


def set_time(path: Path, columns: dict[str, np.ndarray], unit: str | None, rate_hz: float | None) -> None:
    """Make `time_s` of times in a unit, or of `frame`; a clock that begins again goes on.

    Args:
        path: the file, for errors.
        columns: with `time_s` in the unit, or `frame`, and `track_id` and `line`; changed.
        unit: of times; None: seconds.
        rate_hz: frames per second; None: unknown.

    Raises:
        SourceError: a rate is missing, times are too large to be seconds, or see `unwrapped`.
    """
    clock, of_clock = ("frame", None) if "frame" in columns else ("time_s", unit or "s")
    columns[clock] = unwrapped(path, columns[clock], columns["track_id"], columns["line"], of_clock)
    if "frame" in columns:
        if rate_hz is None:
            problem = "frame numbers, but no rate, and no comment says the frame rate"
            remedy = f"Say how many frames a second has: {worded('--rate', 'rate_hz')}"
            raise SourceError(path, None, problem, remedy)
        columns["time_s"] = columns.pop("frame") / rate_hz
    elif unit is not None:
        columns["time_s"] = columns["time_s"] / PER_SECOND[unit]
    largest = np.abs(columns["time_s"]).max(initial=0.0)
    if largest >= LATEST_S:
        written = largest * (PER_SECOND[unit or "s"] if clock == "time_s" else rate_hz or 1.0)
        if _is_date(written):
            problem = f"the time {written:.0f} looks like a date and a time of day in one number"
            raise SourceError(path, None, problem, AS_TIMES)
        looks = next(
            (unit for unit, parts in _PARTS.items() if largest >= _LONG_AGO_S * parts), "milliseconds"
        )
        raise SourceError(path, None, f"the time {largest:.10g} looks like {looks}", other_times())


def _is_date(number: float) -> bool:
    """Whether the digits of a number are a date and a time, such as 20240305140207 or finer ones."""
    digits = f"{number:.0f}"
    if len(digits) not in _DATE_DIGITS or digits[:2] not in _CENTURIES:
        return False
    month, day, hour, minute, second = (int(digits[at : at + 2]) for at in range(4, 14, 2))
    return 1 <= month <= 12 and 1 <= day <= 31 and hour < 24 and max(minute, second) < 60
