"""Which rows of a table are detections."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError, worded
from pedpred.tables.missing import MISSING
from pedpred.tables.names import TrackNames
from pedpred.tables.text import Row
from pedpred.tables.titles import naming

_FEW, _MOST_RESTARTS, _FAR_STEPS = 10, 20, 20
_log = logging.getLogger(__name__)


@dataclass
class _Count:
    """Rows that were left out."""

    rows: int = 0
    first_line: int | None = None
    counted: str = "line"

    def add(self, line: int) -> None:
        self.rows += 1
        self.first_line = self.first_line or line

    def __str__(self) -> str:
        what = "row" if self.rows == 1 else "rows"
        return f"{self.rows} {what}, the first in {self.counted} {self.first_line}"


def without_other_rows(path: Path, rows: Iterable[Row], used: Sequence[int]) -> Iterator[Row]:
    """Leave out rows without a value in all used columns but the clock: they are about something else."""
    others = _Count()
    for line, fields in rows:
        if any(fields[at].strip().lower() not in MISSING for at in used):
            yield line, fields
        else:
            others.add(line)
    if others.rows:
        _log.info("%s: rows with nothing but a time are about something else, and left out: %s", path, others)


def with_positions(path: Path, rows: Iterable[Row], places: Sequence[int], who: int) -> Iterator[Row]:
    """Leave out rows of somebody without a position, which is how missing detections are often written.

    Args:
        path: the file.
        rows: its lines.
        places: the columns of x and y.
        who: the column of ids.
    """
    missing = _Count()
    for line, fields in rows:
        if any(fields[at].strip().lower() in MISSING for at in places) and fields[who].strip():
            missing.add(line)
        else:
            yield line, fields
    if missing.rows:
        _log.warning("%s: rows without a position are missing detections, and left out: %s", path, missing)


def without_copies(
    path: Path,
    columns: dict[str, np.ndarray],
    names: TrackNames | None = None,
    clock: str = "time_s",
    counted: str = "line",
) -> dict[str, np.ndarray]:
    """Leave out rows that say the same as an earlier one.

    Args:
        path: the file, for errors.
        columns: [M] each, with `line`, `track_id` and the clock.
        names: of tracks, for errors.
        clock: the column of times, or of frames where the format has these.
        counted: what `line` counts, a row where the file is no text.

    Raises:
        SourceError: somebody is at two places at once; it names both lines.
    """
    order = np.lexsort((columns[clock], columns["track_id"]))  # stable: the earlier line comes first
    one, other = order[:-1], order[1:]
    again = (columns["track_id"][one] == columns["track_id"][other]) & (
        columns[clock][one] == columns[clock][other]
    )
    same = np.ones_like(again)
    for name, column in columns.items():
        if name != "line":
            same &= column[one] == column[other]
    if (again & ~same).any():
        pairs = one[again & ~same], other[again & ~same]
        raise _at_two_places(path, columns, pairs, names or TrackNames(), clock, counted)
    copies = _Count(int(again.sum()), int(columns["line"][other[again]].min(initial=2**62)), counted)
    if not copies.rows:
        return columns
    _log.warning("%s: rows that repeat another one are left out: %s", path, copies)
    kept = np.sort(np.delete(order, np.flatnonzero(again) + 1))
    return {name: column[kept] for name, column in columns.items()}


def _at_two_places(
    path: Path,
    columns: Mapping[str, np.ndarray],
    pairs: tuple[np.ndarray, np.ndarray],
    names: TrackNames,
    clock: str,
    counted: str,
) -> SourceError:
    """The error that names the first of some pairs of rows, each of one person at one time; see above."""
    earlier, later = pairs
    first = int(np.argmin(columns["line"][later]))
    row, line = earlier[first], int(columns["line"][later[first]])
    who = names.column(columns["track_id"][row : row + 1])[0]
    when = f"{clock} {columns[clock][row]:.10g}"
    problem = f"track_id {who} and {when} again, first in {counted} {columns['line'][row]}, at another place"
    apart = f"If it was recorded in several runs, make a {worded('file', 'table')} for each"
    remedy = f"Remove one of the {counted}s. {apart}"
    rows = len(columns["line"])
    many = clock == "time_s" and 3 * len(later) > rows > _FEW
    if many and len(np.unique(columns["track_id"])) == 1:
        problem += ": all lines have this id"
        remedy = f"If another column holds the ids, name all in order: {naming('time,id,x,y')}"
    elif many and _follow(columns, earlier, later):
        problem += f", as in {len(later)} of {rows} lines: times are too coarse"
        remedy = f"Write times with more decimals, or name all in order: {naming('frame,id,x,y')}"
    if counted != "line":
        return SourceError(path, None, f"{counted} {line}: {problem}", remedy)
    return SourceError(path, line, problem, remedy)


def _follow(columns: Mapping[str, np.ndarray], earlier: np.ndarray, later: np.ndarray) -> bool:
    """Whether most of the later rows are the next ones of that person, and not those of another run."""
    by_line = np.lexsort((columns["line"], columns["track_id"]))
    place = np.empty_like(by_line)
    place[by_line] = np.arange(len(by_line))
    return bool(2 * (place[later] == place[earlier] + 1).sum() >= len(later))


def without_untracked(
    path: Path, columns: dict[str, np.ndarray], names: TrackNames | None = None
) -> dict[str, np.ndarray]:
    """Leave out rows with the id -1 where no other id is negative: trackers write it for nobody.

    Args:
        path: the file, for messages.
        columns: [M] each, with `line` and `track_id`.
        names: of tracks whose ids are words; one may be called -1.
    """
    called = names.of_number if names else {}
    named = [number for number, name in called.items() if name in ("-1", "-1.0")]
    nobody = np.isin(columns["track_id"], named or [-1])
    if not nobody.any() or nobody.all() or (columns["track_id"][~nobody] < 0).any():
        return columns
    left_out = _Count(int(nobody.sum()), int(columns["line"][nobody].min()))
    _log.warning("%s: rows with the id -1 are about nobody who was tracked, and left out: %s", path, left_out)
    return {name: column[~nobody] for name, column in columns.items()}


def doubt_restarts(path: Path, columns: dict[str, np.ndarray]) -> None:
    """Warn if time begins again, with several other people each time, or far back with the same people.

    The former where recordings were joined, the latter where a clock begins again or changes its unit.

    Args:
        path: the file, for messages.
        columns: [M] each, with `line`, `time_s` and `track_id`, in the order of the lines.
    """
    time_s, track_id = columns["time_s"], columns["track_id"]
    back = np.flatnonzero(np.diff(time_s) < 0) + 1
    if not 0 < len(back) <= _MOST_RESTARTS:
        return
    people = [np.unique(ids) for ids in np.split(track_id, back)]
    if min(map(len, people)) > 1 and len(np.unique(np.concatenate(people))) == sum(map(len, people)):
        text = "%s: time goes back in line %d, and other people follow: are these recordings to be divided?"
        _log.warning(text, path, columns["line"][back[0]])
        return
    order = np.argsort(track_id, kind="stable")
    onward_s = np.diff(time_s[order])[np.diff(track_id[order]) == 0]
    far_s = _FAR_STEPS * float(np.median(onward_s[onward_s > 0])) if (onward_s > 0).any() else np.inf
    for row, before in zip(back.tolist(), people, strict=False):
        if time_s[row - 1] - time_s[row] > far_s and track_id[row] in before:
            text = (
                "%s: time goes back from %.10g to %.10g s in line %d, and the same person follows: does %s?"
            )
            cause = "a clock begin again, or its unit change"
            _log.warning(text, path, time_s[row - 1], time_s[row], columns["line"][row], cause)
            return
