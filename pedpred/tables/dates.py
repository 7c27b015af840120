"""Times that are written as dates (2024-03-05T14:02:07.5) or times of day (14:02:07.5, 02:07.5), in seconds.

Spans of time have days before them (`1 days 14:02:07.5`, as pandas writes them, or `1 day, 14:02:07.5`).
Dates may begin with the year, or end with it: 5.3.2024 has the day first, 3/25/2024 the month. Which of both
comes first in 5/3/2024 is found in other rows, or makes no difference where all rows have the same date.
Months may have their English names.
"""

from __future__ import annotations

import logging
import re
from array import array
from collections.abc import Iterator, Sequence
from datetime import date
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError, worded
from pedpred.tables.missing import MISSING
from pedpred.tables.text import AS_TIMES, Row

_CLOCK_SIGNS = r"(?:(\d{1,2}):)?([0-5]\d):([0-5]\d(?:[.,]\d+)?)(?: ?([AaPp])\.?[Mm]\.?)?"
_DATE_SIGNS = r"(\d{1,4})([-/.])(\d{1,2})\2(\d{1,4})"
_NAMES = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_NAME, _YEAR = rf"(?P<month>{'|'.join(_NAMES)})[a-z]*", r"(?P<year>\d{4})"
_NAMED = (
    re.compile(rf"(?P<day>\d{{1,2}})[- ]{_NAME}[- ]{_YEAR}", re.IGNORECASE),
    re.compile(rf"{_NAME} (?P<day>\d{{1,2}}),? {_YEAR}", re.IGNORECASE),
    re.compile(rf"{_YEAR}(?P<month>\d\d)(?P<day>\d\d)[T _-](?P<h>\d\d):?(?P<min>\d\d):?(?P<s>\d\d)"),
)
"""Dates with the name of the month, and without signs between the parts."""
_DATE, _CLOCK = re.compile(rf"{_DATE_SIGNS}$"), re.compile(rf"(?:(\d{{1,5}}) days?,? )?{_CLOCK_SIGNS}$")
_STAMP = re.compile(rf"{_DATE_SIGNS}(?:T|,? +){_CLOCK_SIGNS} ?(Z|UTC|[+-]\d{{2}}(?::?\d{{2}})?)?$")
_MIDNIGHT = re.compile(r"(?:T| +)(?:[0:.]{4,}|12:00(?::00)? ?[Aa]\.?[Mm]\.?)(?:Z|\+00(?::?00)?)?$")
_DIGITS = re.compile(r"(\d{4})(\d\d)(\d\d)$")
"""What follows a date in a column of dates, and a date without signs there."""
_HALF_HOUR_S, _HALF_DAY_S, _DAY_S = 1800.0, 43200.0, 86400
_HOURS, _HALF_DAY_HOURS = 24, 12
_CENTURY, _SHORT, _LONG = 2000, 2, 4
"""The century of years with two digits, and how many digits they have."""
_EPOCH = date(1970, 1, 1).toordinal()
_YEAR_FIRST, _DAY_FIRST, _MONTH_FIRST = (0, 1, 2), (2, 1, 0), (2, 0, 1)
"""Places of year, month and day in a date."""
_FEW = 2
_TITLES = ("date", "datum", "fecha", "data")
_ISO = "Write dates as 2024-03-05"
_log = logging.getLogger(__name__)


class Dates:
    """Writes dates in a column as seconds since 1970, UTC, and times of day as seconds since midnight.

    Programs leave out parts that are zero: other rows say whether 02:07 are minutes and seconds, as beside
    02:07.5, or hours and minutes, as beside 2024-03-05 02:07:01.

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
        self._dated: bool | None = None
        self._orders: tuple[tuple[int, ...], ...] | None = None
        self._open: dict[str, tuple[int, int]] = {}  # date that ends with the year -> first line, place
        self._day_of_row = array("i")
        self._not_used: dict[str, None] = {}  # what stands in the column of dates, where it is not used
        self._two_parts: tuple[int, str] | None = None  # first line that has them, without a fraction
        self._row_of_two, self._of_day_s = array("q"), array("d")  # such rows, as minutes and seconds
        self._has_fractions = self._dated_hours = False  # of such times; beside dates
        self.read_dates = self.read_days = False

    def in_seconds(self, rows: Iterator[Row]) -> Iterator[Row]:
        """The rows with seconds in the column; where dates end with the year, `with_days` adds the days.

        Raises:
            SourceError: something is no such time, or times of day go back by more than half a day (without
                hours, half an hour); it names the line.
        """
        at = self._at
        for count, (line, fields) in enumerate(rows):
            if not count:
                self.read_dates = is_time(fields[at])
            if self._days is not None and not self.read_dates:
                day = _day_alone(fields[self._days])
                self._pass_over(day if _DATE.match(day) else "")
            if self.read_dates:
                fields = [*fields[:at], self._seconds(line, fields, count), *fields[at + 1 :]]
            yield line, fields
        if len(self._not_used) > 1:
            shown = " and ".join(self._not_used)
            text = (
                "%s: times are in column %s, so that the dates %s beside it are not used: all is read as of"
            )
            _log.warning(
                f"{text} one day; write times as 2024-03-05 14:02:07.5", self._path, self._title, shown
            )

    def _pass_over(self, day: str) -> None:
        """Note a day that times do not contain, so that another one is noticed."""
        if len(self._not_used) < _FEW and day.lower() not in MISSING:
            self._not_used.setdefault(day)

    def with_days(self, time_s: np.ndarray) -> np.ndarray:
        """Times with what other rows say: the days of dates that end with the year, and hours.

        Args:
            time_s: what was read from all rows of `in_seconds`. [M]

        Returns:
            [M] s.

        Raises:
            SourceError: a day is in no calendar, or it stays open whether day or month comes first, and the
                time between two rows depends on it, or what two numbers of a time are.
        """
        if self._two_parts and not self._has_fractions:
            if not self._dated_hours:
                line, text = self._two_parts
                problem = f"{self._title} = {text!r}, which may be hours and minutes, or minutes and seconds"
                raise SourceError(self._path, line, problem, AS_TIMES)
            time_s = time_s.copy()
            time_s[np.frombuffer(self._row_of_two, np.int64)] += 59 * np.frombuffer(self._of_day_s)
        if not self._open:
            return time_s
        days = [known for order in self._orders or () if (known := self._days_in(order))]
        if not days:
            text, (line, _) = next(iter(self._open.items()))
            problem = f"{self._title}: no order of day and month fits all dates, such as {text}"
            raise SourceError(self._path, line, problem, _ISO)
        if len({tuple(day - known[0] for day in known) for known in days}) > 1:
            one, other = list(self._open)[:2]
            problem = f"{self._title}: in {one} and {other}, day or month may come first"
            raise SourceError(self._path, self._open[other][0], problem, _ISO)
        return time_s + np.array(days[0], float)[np.frombuffer(self._day_of_row, np.int32)] * _DAY_S

    def _days_in(self, order: tuple[int, ...]) -> list[int] | None:
        """All days since 1970, if year, month and day have these places."""
        try:
            return [_day(text, order) for text in self._open]
        except ValueError:
            return None

    def _seconds(self, line: int, fields: Sequence[str], row: int) -> str:
        text = _plain(fields[self._at])
        day = "" if self._days is None else _day_alone(fields[self._days])
        try:
            divided = bool(_DATE.match(day) and _CLOCK.match(text))
            self.read_days |= divided
            if stamp := _STAMP.match(f"{day} {text}" if divided else text):
                self._check_dated(True)
                *_, zone = stamp.groups()
                of_day_s = self._of_day(line, row, text, stamp.groups()[-5:-1])
                return repr(self._days_s(line, stamp) + of_day_s - _shift_s(zone))
            if clock := _CLOCK.match(text):
                self._check_dated(False)
                self._pass_over(day)
                days, *of_day = clock.groups()
                half_s = _HALF_DAY_S if of_day[0] else _HALF_HOUR_S
                of_day_s = self._of_day(line, row, text, of_day)
                return repr(self._rising(line, _DAY_S * int(days or 0) + of_day_s, text, half_s))
        except ValueError as cause:
            problem = f"{self._title} = {text[:80]!r}, {cause}"
            raise SourceError(self._path, line, problem, AS_TIMES) from cause
        raise SourceError(self._path, line, f"{self._title} = {text[:80]!r} is not a time", AS_TIMES)

    def _of_day(self, line: int, row: int, text: str, parts: Sequence[str | None]) -> float:
        """Seconds since midnight; two numbers are taken as minutes and seconds until all rows are read."""
        hours, minutes, seconds, half = parts
        of_day_s = _of_day(hours, minutes or "", seconds or "", half)
        if hours is not None:
            self._dated_hours |= bool(self._dated)
        elif (seconds or "").isdecimal():
            self._two_parts = self._two_parts or (line, text[:80])
            self._row_of_two.append(row)
            self._of_day_s.append(of_day_s)
        else:
            self._has_fractions = True
        return of_day_s

    def _check_dated(self, dated: bool) -> None:
        """Check that all rows have a date, or none has."""
        if self._dated not in (None, dated):
            raise ValueError(f"{'with' if dated else 'without'} a date, unlike the rows before")
        self._dated = dated

    def _days_s(self, line: int, stamp: re.Match[str]) -> int:
        """Seconds until the day begins; 0 if it stays open which day it is."""
        text = stamp[1] + stamp[2] + stamp[3] + stamp[2] + stamp[4]
        orders = _orders(text)
        if not orders:
            raise ValueError("but a year has four digits")
        if self._orders not in (None, orders):
            raise ValueError("but the dates before are written otherwise")
        self._orders = orders
        if len(orders) == 1:
            return _DAY_S * _day(text, orders[0])
        _, place = self._open.setdefault(text, (line, len(self._open)))
        self._day_of_row.append(place)
        return 0

    def _rising(self, line: int, time_s: float, text: str, half_s: float) -> float:
        if self._latest_s is not None and time_s < self._latest_s - half_s:
            ended = "the evening" if half_s == _HALF_DAY_S else "the end of an hour"
            problem = f"{self._title} goes back from {ended} to {text[:5]}"
            raise SourceError(
                self._path,
                line,
                problem,
                f"Write dates with the times, or divide the {worded('file', 'table')}",
            )
        self._latest_s = time_s
        return time_s


def is_time(field: str) -> bool:
    """Whether a field holds a date with a time, or a time of day."""
    return bool(_STAMP.match(_plain(field)) or _CLOCK.match(field.strip()))


def column_of_days(titles: Sequence[str]) -> int | None:
    """The column of dates, if one has the title `date`, also in other languages."""
    return next((at for at, title in enumerate(titles) if title.strip().lower() in _TITLES), None)


def _plain(field: str) -> str:
    """A date with its parts as numbers, the year first, where it has the name of the month, or no signs."""
    text = field.strip()
    named = next((match for form in _NAMED if (match := form.match(text))), None)
    if named is None:
        return text
    part = named.groupdict()
    month = _NAMES.index(part["month"].lower()) + 1 if part["month"].isalpha() else int(part["month"])
    clock = f" {part['h']}:{part['min']}:{part['s']}" if "h" in part else ""
    return f"{part['year']}-{month}-{part['day']}{clock}{text[named.end() :]}"


def _day_alone(field: str) -> str:
    """A date with signs between its parts, from a field that may say midnight, too."""
    text = _MIDNIGHT.sub("", _plain(field))
    return _DIGITS.sub(r"\1-\2-\3", text)


def _orders(text: str) -> tuple[tuple[int, ...], ...]:
    """The orders that year, month and day may have in a date, by its form."""
    first, _, last = re.split(r"[-/.]", text)
    if len(first) == _LONG:
        return (_YEAR_FIRST,)
    if len(first) > _SHORT or len(last) not in (_SHORT, _LONG):
        return ()
    if "." in text:
        return (_DAY_FIRST,)
    return (_DAY_FIRST, _MONTH_FIRST) + ((_YEAR_FIRST,) if len(last) == _SHORT else ())


def _day(text: str, order: tuple[int, ...]) -> int:
    """Days since 1970.

    Raises:
        ValueError: no calendar has the day.
    """
    parts = [int(part) for part in re.split(r"[-/.]", text)]
    year, month, day = (parts[place] for place in order)
    return date(year if year >= 10**_SHORT else _CENTURY + year, month, day).toordinal() - _EPOCH


def _of_day(hours: str | None, minutes: str, seconds: str, half: str | None) -> float:
    hour = int(hours or 0)
    if half and not 1 <= hour <= _HALF_DAY_HOURS:
        raise ValueError(f"but half a day has {_HALF_DAY_HOURS} hours")
    if half:
        hour = hour % _HALF_DAY_HOURS + (_HALF_DAY_HOURS if half in "Pp" else 0)
    if hour >= _HOURS:
        raise ValueError(f"but a day has {_HOURS} hours")
    return 3600 * hour + 60 * int(minutes) + float(seconds.replace(",", "."))


def _shift_s(zone: str | None) -> int:
    if not zone or zone[0] not in "+-":
        return 0
    return (1 if zone[0] == "+" else -1) * (3600 * int(zone[1:3]) + 60 * int(zone[3:].strip(":") or 0))
