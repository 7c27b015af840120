"""Units of length and of time, and the words for them."""

from __future__ import annotations

from dataclasses import dataclass

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "inch": 0.0254}
"""Units of length by their names in files, m."""

PER_SECOND = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9, "min": 1 / 60}
"""Units of time by their names in files: how many a second has."""

_METRES = ("meter", "meters", "metre", "metres", "metern", "metri", "metros")
_PREFIXES = {"": "", "c": "centi", "m": "milli"}
LENGTH_WORDS = {
    word: f"{short}m"
    for short, long in _PREFIXES.items()
    for word in (f"{short}m", *(f"{long}{metre}" for metre in _METRES))
}
LENGTH_WORDS |= {"zentimeter": "cm", "ft": "ft", "feet": "ft", "inch": "inch", "inches": "inch"}
PIXELS = "px"
LENGTH_WORDS |= dict.fromkeys(("px", "pix", "pixel", "pixels"), PIXELS)
"""Word -> unit of length, or `PIXELS`."""

TIME_WORDS = {
    word: unit
    for unit, words in {
        "s": "s sec secs second seconds sek sekunde sekunden seconde secondes segundo segundos secondi",
        "ms": "ms msec msecs millis millisec millisecs millisecond milliseconds",
        "us": "us usec usecs micros microsec microsecs microsecond microseconds",
        "ns": "ns nsec nsecs nanos nanosec nanosecs nanosecond nanoseconds",
        "min": "min mins minute minutes",
    }.items()
    for word in words.split()
}
"""Word -> unit of time."""


@dataclass
class FoundUnit:
    """The unit of lengths that titles, units below them, comments or the caller say, which readers set.

    Attributes:
        of_lengths: a key of `UNITS`, or `PIXELS`; None: nobody says it.
        rate_hz: frames per second, where times are frame numbers.
    """

    of_lengths: str | None = None
    rate_hz: float | None = None
