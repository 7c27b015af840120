"""What the columns of a table hold, by their titles."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from pedpred.errors import SourceError, ValueRuleError
from pedpred.storage.tracks import TRACK_COLUMNS

NAMES = {
    "time_s": ("t", "time", "time_s", "timestamp"),
    "time_ms": ("t_ms", "time_ms", "timestamp_ms"),
    "frame": ("frame", "frame_id"),
    "track_id": ("id", "track", "track_id", "ped_id", "agent_id"),
    "x_m": ("x", "x_m", "pos_x"),
    "y_m": ("y", "y_m", "pos_y"),
}
"""What the columns may be called; upper and lower case are the same."""

_KNOWN = {alias: name for name, aliases in NAMES.items() for alias in aliases}
_KNOWN |= {name: name for name in TRACK_COLUMNS}
LENGTHS = ("x_m", "y_m")
_WITH_UNIT = re.compile(r"(.*?)\s*[ _/\[(]\s*(cm|mm|m)[\])]?")
_CLOCKS = ("time_s", "time_ms", "frame")


def titles_of_tracks(titles: Sequence[str]) -> dict[str, str]:
    """Title -> name of the columns that hold tracks.

    Raises:
        ValueRuleError: one is missing or there twice.
    """
    named: dict[str, str] = {}
    for title in titles:
        if name := _name_of(title):
            if name in named:
                raise ValueRuleError("columns", titles, f"columns {named[name]} and {title} are both {name}")
            named[name] = title
    clock = next((name for name in _CLOCKS if name in named), "time_s")
    for name in (clock, "track_id", "x_m", "y_m"):
        if name not in named:
            aliases = [alias for n in (_CLOCKS if name == clock else (name,)) for alias in NAMES[n]]
            rule = f"no column for {name}, which may be called {', '.join(aliases)}"
            found = " | ".join(titles)[:200]
            separators = "commas, semicolons, tabs or blanks between them"
            raise ValueRuleError("columns", titles, f"{rule}. Found were {found}; expected {separators}")
    return {title: name for name, title in named.items() if name == clock or name not in _CLOCKS}


def _name_of(title: str) -> str | None:
    """The name of a column by its title; those of lengths may say a unit."""
    if name := _KNOWN.get(title.lower()):
        return name
    match = _WITH_UNIT.fullmatch(title.lower())
    name = _KNOWN.get(match[1]) if match else None
    return name if name in LENGTHS else None


def unit_of(path: Path, wanted: Mapping[str, str], given: str | None) -> str:
    """The unit of lengths that the titles or the caller say; metres if nobody does.

    Raises:
        SourceError: they differ.
    """
    titles = [title for title, name in wanted.items() if name in LENGTHS]
    said = {match[2] for title in titles if (match := _WITH_UNIT.fullmatch(title.lower()))}
    units = said | ({given} if given else set())
    if len(units) > 1:
        found = " and ".join(sorted(units))
        raise SourceError(path, None, f"lengths are said to be {found}", "Correct titles or --unit")
    return units.pop() if units else "m"
