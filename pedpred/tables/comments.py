"""What comments of a text say about its rows: frames per second, unit of lengths."""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Iterable, Sequence
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
_FRAMES = r"(?:fps|frames per second)\b"
_RATE = re.compile(
    r"(?:frame[ _-]?rate|fps|frames per second)\s*(?:[(\[][^)\]]*[)\]])?\W*?(?:is\W+|of\W+)?"
    rf"(?<!\d){_NUMBER}(?:\s*(?:hz\b|{_FRAMES}))?|(?<!\w)(?<!\d[.,]){_NUMBER}\s*{_FRAMES}",
    re.IGNORECASE,
)
"""A rate, such as 16, 29,97, 1.6e+01 or 30000/1001, behind its name or before its unit."""
_DATA = r"data|update|output|recording|record|camera|video|tracking|capture|acquisition|detection|annotation"
_SAMPLED = (
    r"\b(?:(?:re|down|sub)?sampled|recorded|captured|tracked|annotated|published|stored|saved|exported)"
    r"(?:\s+(?:at|with|to))?\s+",
    rf"(?:^\W*|\b(?:sampl\w*|{_DATA})\s+)(?:rate|frequency)\s*(?:is|of|[:=])?\s*",
    rf"\b(?:{_DATA}|positions|trajectories|tracks|rows|detections)\s+(?:is|are\s+)?(?:at|with)\s+",
    r"^\W*(?=[\d.,]+\s*hz\W*$)",
)
_HERTZ = re.compile(rf"({'|'.join(_SAMPLED)})?(?<!\w)(?<!\d[.,]){_NUMBER}\s*hz\b", re.IGNORECASE)
"""A number of hertz, perhaps behind words that say that it is the rate of what a file holds."""
_FILTERS = re.compile(r"filter|cut-?\s?off|pass\b|smooth|butterworth|gait|stride", re.IGNORECASE)
"""Of clauses whose hertz are those of something else."""
_WHAT = (
    r"x|y|all|data|everything|values?|units?|lengths?|pos|positions?|coords?|coordinates?|distances?|points?"
    r"|tracks?|trajector(?:y|ies)|locations?"
)
_GIVEN = (
    r"all|alles|everything|data|daten|values?|werte|given|saved|stored|written|exported|expressed|reported"
    r"|recorded|measured|gemessen|überall|angaben|mesures"
)
_BEFORE = (
    r"\b[xy]\s*[/\[(_:=]?\s*",
    rf"\b(?:{_WHAT})\b[^,;]*?\b(?:in|is|are)\s+",
    rf"^\W*(?:(?:{_GIVEN})\W+)*in\s+(?=\w+\W*$)",
    r"\b(?:units?|lengths?|positions?|coordinates?|distances?)\s*[:=(\[/]\s*",
    r"\bunits?\s*[,;|\s]\s*",
    r"^[#\s]*(?=\w+\s*$)",
)
_UNIT = re.compile(
    rf"(?:{'|'.join(_BEFORE)})({'|'.join(sorted(LENGTH_WORDS, key=len, reverse=True))})\b"
    r"(?!\s+(?:mode|steps?|resolution|accuracy|precision|grid|cells?|range)\b)",
    re.IGNORECASE,
)
_SURE = re.compile(
    r"(?:[xy]\b|[xy]_|(?:(?:all|the)\s+)*(?:units?|lengths?|positions?|coordinates?|coords?)\b)",
    re.IGNORECASE,
)
"""How words begin that say the unit of x and y; what else is said counts if the caller does not differ."""


_SENSOR = r"(?:camera|sensor|lidar)s?"
_OF_SENSOR = r"(?:position|location|height|pose|offset|origin|distance)s?"
_OTHERS = (
    r"(?:(?:all|the|units?|lengths?|of)\s+)*"
    r"(?:z|heights?|radi(?:us|i)|diameters?|widths?|sizes?|shoulders?|speeds?|velocit(?:y|ies))",
    rf"(?:all\s+|the\s+)*{_SENSOR}\s+{_OF_SENSOR}",
    rf"(?:distance|depth|range)\s+{_SENSOR}",
    r"(?:all\s+|the\s+)*(?:lengths?\s+of\s+(?:the\s+)?(?:steps?|strides?|walls?)|distances?\s+between)",
    rf"(?:all\s+|the\s+)*{_OF_SENSOR}\s+of\s+(?:(?:the|a|all|each)\s+)?{_SENSOR}",
)
_ASIDE = re.compile(
    rf"(?:^|[,;:(])\W*(?:{'|'.join(_OTHERS)})\b(?!\s*(?:and\b|und\b|[&+/]))[^,;]*", re.IGNORECASE
)
"""What a comment says of something else than x and y, up to the next comma."""


_CLAUSE = re.compile(r"[;()]|,(?!\d)")
_LATER = "\nthen "
"""Begins a clause that is not the first one of a comment."""
_log = logging.getLogger(__name__)


def frame_rate_hz(path: Path, comments: Sequence[str], stated_hz: float | None) -> float | None:
    """Frames per second from comments or the caller; None: unknown.

    Hertz count where a comment says that these are the rate, and nobody else says it: the caller is believed.
    Others are named in a warning.

    Raises:
        SourceError: they differ, or it is out of range.
    """
    matches = (match for comment in comments for match in _RATE.finditer(comment))
    said = _different(_rate_hz(match[1] or match[3], match[2] or match[4]) for match in matches)
    stated = [float(stated_hz)] if stated_hz else []
    if not said:
        said = _hertz(path, comments, stated_hz)
    rates = [rate for rate in said if any(is_same_rate(rate, other) for other in stated)] or [*said, *stated]
    if len(rates) > 1 or not all(SLOWEST_HZ <= rate <= FASTEST_HZ for rate in rates):
        found_hz = " and ".join(f"{rate:g}" for rate in sorted(rates))
        problem = f"frame rate {found_hz} Hz, expected one from 0.001 to 1000000 Hz"
        remedy = ", or say which: --rate" if len(said) > 1 else ", or leave --rate out" if stated_hz else ""
        raise SourceError(path, None, problem, f"Correct the comment{remedy}")
    return rates[0] if rates else None


def _different(rates: Iterable[float]) -> list[float]:
    """The rates, each once."""
    different: list[float] = []
    for rate in rates:
        if not any(is_same_rate(rate, other) for other in different):
            different.append(rate)
    return different


def _hertz(path: Path, comments: Sequence[str], stated_hz: float | None) -> list[float]:
    """The rates in hertz that comments say, unless the caller says another one; doubts are logged."""
    clauses = [clause for comment in comments for clause in _CLAUSE.sub(_LATER, comment).split(_LATER[0])]
    found = [match for text in clauses if not _FILTERS.search(text) for match in _HERTZ.finditer(text)]
    said = _different(_rate_hz(match[2], match[3]) for match in found if match[1] is not None)
    if stated_hz:
        if said and not any(is_same_rate(rate, stated_hz) for rate in said):
            shown = " and ".join(f"{rate:g}" for rate in said)
            _log.warning("%s: a comment says %s Hz, and --rate %g is used", path, shown, stated_hz)
        return []
    if not said and (others := _different(_rate_hz(match[2], match[3]) for match in found)):
        text = "%s: a comment speaks of %s Hz: if that is the rate of the frame numbers, say --rate %g"
        _log.warning(text, path, " and ".join(f"{rate:g}" for rate in others), others[0])
    return said


def _rate_hz(number: str, parts: str | None) -> float:
    """The rate that a comment says; infinite where it is divided by zero."""
    divisor = float(parts or 1)
    return float(number.replace(",", ".")) / divisor if divisor else math.inf


def unit_of_lengths(path: Path, comments: Sequence[str], options: TableOptions) -> str | None:
    """Unit of lengths, or pixels, from comments or the caller; None: unknown.

    Raises:
        SourceError: they differ.
    """
    stated = PIXELS if options.are_pixels else options.unit
    texts = [_ASIDE.sub("", text) for text in comments]
    found = [match for text in texts for match in _UNIT.finditer(text)]
    units = {LENGTH_WORDS[match[1].lower()] for match in found}
    if stated is not None:
        sure = {LENGTH_WORDS[match[1].lower()] for match in found if _SURE.match(match[0])}
        if others := sorted(units - sure - {stated}):
            text = "%s: a comment speaks of %s, and lengths are read as %s, as was said"
            _log.warning(text, path, " and ".join(others), stated)
        units = sure
        units = units & {stated} if len(units) > 1 and stated in units else units | {stated}
    if len(units) > 1:
        said = " and ".join(sorted(units))
        raise SourceError(
            path, None, f"lengths are said to be {said}", "Correct the comment, --unit or --scale"
        )
    return units.pop() if units else None
