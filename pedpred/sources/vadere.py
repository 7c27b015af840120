"""Trajectories of Vadere (`postvis.traj`): a footstep per line, with its begin and its end.

    pedestrianId simTime endTime-PID1 startX-PID1 startY-PID1 endX-PID1 endY-PID1 targetId-PID2

Within a footstep, people move in a straight line, as Vadere shows it. They are detected at equal intervals,
and stand between two footsteps; where the next one begins elsewhere, nobody knows where they are in between.
"""

from __future__ import annotations

import logging
import re
from functools import partial
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError
from pedpred.files import translate_errors
from pedpred.scenes import Trajectories
from pedpred.scenes.scene import LATEST_S
from pedpred.sources.beginnings import Beginning
from pedpred.storage.tracks import MOST_NUMBERS
from pedpred.tables.detections import without_copies
from pedpred.tables.options import TableOptions
from pedpred.tables.text import read_numbers, text_rows

_WANTED = {
    "pedestrianId": "track_id",
    "simTime": "begin_s",
    "endTime": "end_s",
    **{title: title for title in ("startX", "startY", "endX", "endY")},
}
_PROCESSOR = re.compile(r"-PID\d+$")
_USUAL_HZ = 5.0
_ELSEWHERE_M = 0.1
_log = logging.getLogger(__name__)


def fits(begins: Beginning) -> bool:
    """Whether the header is that of footsteps."""
    return {"pedestrianId", "simTime"} <= set(begins.line().split())


def read(path: Path, options: TableOptions) -> Trajectories:
    """Read the footsteps, and where people are in them.

    Args:
        path: the file.
        options: `rate_hz` says how often people are detected, 5 Hz unless it is given.

    Raises:
        SourceError: a column is missing, or a line is wrong.
    """
    rows = ((line, fields) for line, fields in text_rows(path) if not fields[0].startswith("#"))
    _, header = next(rows, (1, []))
    titles = [_PROCESSOR.sub("", title) for title in header]
    if missing := [title for title in _WANTED if titles.count(title) != 1]:
        problem = f"{titles.count(missing[0])} columns {missing[0]}; there are {', '.join(header)[:200]}"
        raise SourceError(path, None, problem, "Write them with the FootStepProcessor")
    columns = read_numbers(path, rows, titles, _WANTED)
    if not len(columns["line"]):
        raise SourceError(path, None, "no footsteps")
    with translate_errors(partial(SourceError, path, None)):
        columns = without_copies(path, columns, clock="begin_s")
        return _sampled(path, columns, options.rate_hz or _USUAL_HZ)


def _sampled(path: Path, columns: dict[str, np.ndarray], rate_hz: float) -> Trajectories:
    """Where everybody is at whole multiples of the interval, from the first to the last footstep."""
    if (backwards := np.flatnonzero(columns["end_s"] < columns["begin_s"])).size:
        raise SourceError(path, int(columns["line"][backwards[0]]), "endTime is before simTime")
    if (strange := np.flatnonzero(~(np.abs(columns["end_s"]) + np.abs(columns["begin_s"]) < LATEST_S))).size:
        raise SourceError(
            path, int(columns["line"][strange[0]]), "simTime or endTime is too large for seconds"
        )
    who = np.repeat(columns["track_id"], 2)
    when = np.stack([columns["begin_s"], columns["end_s"]], axis=-1).ravel()
    x, y = (np.stack([columns[f"start{axis}"], columns[f"end{axis}"]], axis=-1).ravel() for axis in "XY")
    order = np.lexsort((when, who))  # stable: the end of a step comes before the begin of the next one
    who, when, x, y = who[order], when[order], x[order], y[order]
    first = np.flatnonzero(np.append(True, who[1:] != who[:-1]))
    last = np.append(first[1:], len(who))
    low, high = np.ceil(when[first] * rate_hz - 1e-6), np.floor(when[last - 1] * rate_hz + 1e-6)
    if (high - low + 1).sum() > MOST_NUMBERS // 4:
        raise SourceError(path, None, f"{(high - low).sum():.3g} detections are too many", "Lower --rate")
    parts, left_out = [], 0
    for k, (begin, end) in enumerate(zip(first, last, strict=True)):
        every, times = np.arange(low[k] + 0.0, high[k] + 1) / rate_hz, when[begin:end]
        at = every[_is_known(every, times, x[begin:end], y[begin:end])]
        left_out += len(every) - len(at)
        parts.append(
            (at, np.full(len(at), who[begin]), *(np.interp(at, times, v[begin:end]) for v in (x, y)))
        )
    if left_out:
        text = (
            "%s: %d detections between footsteps that begin elsewhere than the ones before ended are left out"
        )
        _log.warning(text, path, left_out)
    time_s, track_id, x, y = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Trajectories(time_s, track_id, np.stack([x, y], axis=-1))


def _is_known(at: np.ndarray, when: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Whether a person is in a footstep at some times (s, [Q]), or stands between two. [Q] bool.

    Args:
        at: within the times of the footsteps.
        when: begin and end of each footstep, in turn, s. [2 F]
        x: where the person is then, m. [2 F]
        y: likewise. [2 F]
    """
    leaps = np.hypot(np.diff(x), np.diff(y)) > _ELSEWHERE_M
    leaps[::2] = False  # within a footstep
    before = np.clip(np.searchsorted(when, at, "right") - 1, 0, len(leaps) - 1)
    between = (at > when[before]) & (at < when[before + 1])
    return ~(leaps[before] & between)
