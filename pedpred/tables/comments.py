"""What comments of a text say about its rows: frames per second, unit of lengths."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

from pedpred.errors import SourceError
from pedpred.tables.options import FASTEST_HZ, SLOWEST_HZ, TableOptions, is_same_rate
from pedpred.tables.units import LENGTH_WORDS, PIXELS

MOST_COMMENTS = 1000
"""More are not looked at."""

NO_RATE = (
    "no comment says the frame rate",
    "Say it: --rate, frame_rate_hz in the settings of a place, or a first line `# framerate: 16`",
)
"""Problem and remedy where nobody says how many frames a second has."""

_NUMBER = r"((?:\d+[.,]\d+|(?<!\.)\.\d+|\d+)(?:e[+-]?\d+)?)(?:/(\d+))?"
_PER_SECOND = r"(?:fps|hz|frames per second)\b"
_RATE = re.compile(
    r"(?:frame[ _-]?rate|fps|frames per second)\s*(?:[(\[][^)\]]*[)\]])?\W*?(?:is\W+|of\W+)?"
    rf"(?<!\d){_NUMBER}(?:\s*{_PER_SECOND})?|(?<!\w)(?<!\d[.,]){_NUMBER}\s*{_PER_SECOND}",
    re.IGNORECASE,
)
"""A rate, such as 16, 29,97, 1.6e+01 or 30000/1001, behind its name or before its unit."""
_WHAT = (
    r"x|y|all|data|everything|values?|units?|lengths?|pos|positions?|coords?|coordinates?|distances?|points?"
    r"|tracks?|trajector(?:y|ies)|locations?"
)
_BEFORE = (
    r"\b[xy]\s*[/\[(_:=]?\s*",
    rf"\b(?:{_WHAT})\b[^,;]*?\b(?:in|is|are)\s+",
    r"^\W*(?:\w+\W+)?in\s+(?=\w+\W*$)",
    r"\b(?:units?|lengths?|positions?|coordinates?|distances?)\s*[:=(\[/]\s*",
    r"\bunits?\s*[,;|\s]\s*",
    r"^[#\s]*(?=\w+\s*$)",
)
_UNIT = re.compile(
    rf"(?:{'|'.join(_BEFORE)})({'|'.join(sorted(LENGTH_WORDS, key=len, reverse=True))})\b", re.IGNORECASE
)


_SENSOR = r"(?:camera|sensor|lidar)s?"
_OF_SENSOR = r"(?:position|location|height|pose|offset|origin|distance)s?"
_OTHERS = (
    r"(?:(?:all|the|units?|lengths?|of)\s+)*"
    r"(?:z|heights?|radi(?:us|i)|diameters?|widths?|sizes?|shoulders?|speeds?|velocit(?:y|ies))",
    rf"(?:all\s+|the\s+)*{_SENSOR}\s+{_OF_SENSOR}",
    rf"(?:all\s+|the\s+)*{_OF_SENSOR}\s+of\s+(?:(?:the|a|all|each)\s+)?{_SENSOR}",
)
_ASIDE = re.compile(
    rf"(?:^|[,;:(])\W*(?:{'|'.join(_OTHERS)})\b(?!\s*(?:and\b|und\b|[&+/]))[^,;]*", re.IGNORECASE
)
"""What a comment says of something else than x and y, up to the next comma."""


def frame_rate_hz(path: Path, comments: Sequence[str], stated_hz: float | None) -> float | None:
    """Frames per second from comments or the caller; None: unknown.

    Raises:
        SourceError: they differ, or it is out of range.
    """
    said: list[float] = []
    for match in (match for comment in comments for match in _RATE.finditer(comment)):
        if not any(is_same_rate(_rate_hz(match), rate) for rate in said):
            said.append(_rate_hz(match))
    stated = [float(stated_hz)] if stated_hz else []
    rates = [rate for rate in said if any(is_same_rate(rate, other) for other in stated)] or [*said, *stated]
    if len(rates) > 1 or not all(SLOWEST_HZ <= rate <= FASTEST_HZ for rate in rates):
        found_hz = " and ".join(f"{rate:g}" for rate in sorted(rates))
        problem = f"frame rate {found_hz} Hz, expected one from 0.001 to 1000000 Hz"
        remedy = ", or say which: --rate" if len(said) > 1 else ", or leave --rate out" if stated_hz else ""
        raise SourceError(path, None, problem, f"Correct the comment{remedy}")
    return rates[0] if rates else None


def _rate_hz(match: re.Match[str]) -> float:
    """The rate that a comment says; infinite where it is divided by zero."""
    number, parts = match[1] or match[3], float(match[2] or match[4] or 1)
    return float(number.replace(",", ".")) / parts if parts else math.inf


def unit_of_lengths(path: Path, comments: Sequence[str], options: TableOptions) -> str | None:
    """Unit of lengths, or pixels, from comments or the caller; None: unknown.

    Raises:
        SourceError: they differ.
    """
    stated = PIXELS if options.are_pixels else options.unit
    texts = [_ASIDE.sub("", text) for text in comments]
    units = {LENGTH_WORDS[match[1].lower()] for text in texts for match in _UNIT.finditer(text)}
    if stated is not None:
        units = units & {stated} if len(units) > 1 and stated in units else units | {stated}
    if len(units) > 1:
        said = " and ".join(sorted(units))
        raise SourceError(
            path, None, f"lengths are said to be {said}", "Correct the comment, --unit or --scale"
        )
    return units.pop() if units else None
