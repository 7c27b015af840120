"""Times that are written as dates (2024-03-05T14:02:07.5) or times of day (14:02:07.5), in seconds."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from datetime import datetime, timezone
from pathlib import Path

from pedpred.errors import SourceError
from pedpred.tables.text import AS_TIMES, Row

_DATE = re.compile(r"\d{4}[-/]\d{1,2}[-/]\d{1,2}$")
_CLOCK = re.compile(r"(\d{1,2}):([0-5]\d):([0-5]\d(?:[.,]\d+)?)$")
_STAMP = re.compile(
    r"(\d{4})[-/](\d{1,2})[-/](\d{1,2})[T ]+(\d{1,2}:\d{2}:\d{2}(?:[.,]\d+)?) ?(Z|UTC|[+-]\d{2}:?\d{2})?$"
)
_HOURS, _HALF_DAY_S = 24, 43200.0


class Dates:
    """Writes dates in a column as seconds since 1970, UTC, and times of day as seconds since midnight.

    The first row decides whether a column holds them. Dates without a zone are taken as UTC.

    Args:
        path: the file, for errors.
        title: of the column.
        at: the column.
        days: the column of dates beside one of times of day; None: there is none.
    """

    def __init__(self, path: Path, title: str, at: int, days: int | None):
        self._path, self._title, self._at, self._days = path, title, at, days
        self._latest_s: float | None = None
        self.found = False

    def in_seconds(self, rows: Iterator[Row]) -> Iterator[Row]:
        """The rows with seconds in the column.

        Raises:
            SourceError: something is no such time, or times of day go back by more than half a day; it names
                the line.
        """
        at = self._at
        for count, (line, fields) in enumerate(rows):
            if not count:
                self.found = is_date(fields[at]) or bool(_CLOCK.match(fields[at].strip()))
            yield (
                line,
                [*fields[:at], self._seconds(line, fields), *fields[at + 1 :]] if self.found else fields,
            )

    def _seconds(self, line: int, fields: Sequence[str]) -> str:
        text = fields[self._at].strip()
        day = "" if self._days is None else fields[self._days].strip()
        try:
            if stamp := _STAMP.match(f"{day} {text}" if _DATE.match(day) and _CLOCK.match(text) else text):
                return repr(_since_1970(*stamp.groups()))
            if clock := _CLOCK.match(text):
                return repr(self._of_day(line, *clock.groups()))
        except ValueError as cause:
            problem = f"{self._title} = {text[:80]!r}, {cause}"
            raise SourceError(self._path, line, problem, AS_TIMES) from cause
        raise SourceError(self._path, line, f"{self._title} = {text[:80]!r} is not a time", AS_TIMES)

    def _of_day(self, line: int, hours: str, minutes: str, seconds: str) -> float:
        if int(hours) >= _HOURS:
            raise ValueError(f"but a day has {_HOURS} hours")
        time_s = 3600 * int(hours) + 60 * int(minutes) + float(seconds.replace(",", "."))
        if self._latest_s is not None and time_s < self._latest_s - _HALF_DAY_S:
            problem = f"{self._title} goes back from the evening to {hours}:{minutes}: a day has ended"
            raise SourceError(self._path, line, problem, "Write dates with the times, or divide the file")
        self._latest_s = time_s
        return time_s


def is_date(field: str) -> bool:
    """Whether a field holds a date with a time."""
    return bool(_STAMP.match(field.strip()))


def column_of_days(titles: Sequence[str]) -> int | None:
    """The column of dates, if one has the title `date`."""
    return next((at for at, title in enumerate(titles) if title.strip().lower() == "date"), None)


def _since_1970(year: str, month: str, day: str, clock: str, zone: str | None) -> float:
    hours, minutes, seconds = clock.replace(",", ".").split(":")
    whole, _, part = seconds.partition(".")
    moment = datetime(
        int(year), int(month), int(day), int(hours), int(minutes), int(whole), tzinfo=timezone.utc
    )
    shift_s = 0
    if zone and zone[0] in "+-":
        shift_s = (1 if zone[0] == "+" else -1) * (3600 * int(zone[1:3]) + 60 * int(zone[-2:]))
    return moment.timestamp() - shift_s + float(f"0.{part or 0}")
