"""Trajectories of Vadere (`postvis.traj`): a footstep per line, with its begin and its end.

    pedestrianId simTime endTime-PID1 startX-PID1 startY-PID1 endX-PID1 endY-PID1 targetId-PID2
    1 0.2 0.6 1.2 2.0 1.6 2.0 1

Within a footstep, people move in a straight line, as Vadere shows it. They are detected at equal intervals,
and stand between two footsteps; where the next one begins elsewhere, the position in between is unknown.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa

from pedpred.reading.errors import ContentError, row_error
from pedpred.reading.head import Head
from pedpred.reading.options import ReadOptions
from pedpred.reading.table import Table
from pedpred.reading.text import (
    BLANKS,
    TextForm,
    check_size,
    finite_numbers,
    first_lines,
    read_columns,
    whole_numbers,
)
from pedpred.scenes.scene import LATEST_S

NAME = "Vadere"
_TITLES = ("pedestrianId", "simTime", "endTime", "startX", "startY", "endX", "endY")
_USUAL_HZ, _ELSEWHERE_M = 5.0, 0.1


def recognises(head: Head) -> bool:
    """Whether the header is that of footsteps."""
    return {"pedestrianId", "simTime"} <= set(head.line.split())


def read(path: Path, options: ReadOptions) -> Table:
    """Read the footsteps, and where people are in them, at 5 Hz unless `options` says another rate.

    Raises:
        ContentError: a column is missing, or times are wrong.
    """
    lines = first_lines(path, 10)
    skipped = next(at for at, line in enumerate(lines) if line.strip() and not line.startswith("#")) + 1
    titles = [re.sub(r"-PID\d+$", "", title) for title in lines[skipped - 1].split()]
    if missing := [title for title in _TITLES if titles.count(title) != 1]:
        problem = f"{titles.count(missing[0])} columns {missing[0]}; there are {', '.join(titles)[:200]}"
        raise ContentError(problem, "Write them with the FootStepProcessor")
    table = read_columns(path, TextForm(titles, BLANKS, skipped), {title: title for title in _TITLES}, ())
    steps = {title: finite_numbers(table[title].to_numpy(), title, skipped) for title in _TITLES}
    for row in np.flatnonzero(steps["endTime"] < steps["simTime"])[:1]:
        raise row_error(row, skipped, "endTime is before simTime")
    if not (np.abs([steps["simTime"], steps["endTime"]]) < LATEST_S).all():
        raise ContentError("simTime or endTime is too large for seconds")
    rate_hz = options.rate_hz or _USUAL_HZ
    who = whole_numbers(steps["pedestrianId"], "pedestrianId", skipped)
    return Table(_interpolate(steps, who, rate_hz), "m", rate_hz)


def _interpolate(steps: Mapping[str, np.ndarray], track_id: np.ndarray, rate_hz: float) -> pa.Table:
    """Interpolate positions at whole multiples of the interval, from the first to the last footstep."""
    both = {"t": ("simTime", "endTime"), "x": ("startX", "endX"), "y": ("startY", "endY")}
    knots = {name: np.stack([steps[title] for title in pair], -1) for name, pair in both.items()}
    parts, count = [np.zeros((4, 0))], 0
    for who in np.unique(track_id):
        own = np.flatnonzero(track_id == who)
        own = own[np.argsort(knots["t"][own, 0], kind="stable")]
        when, x, y = (knots[name][own].ravel() for name in "txy")
        first, last = np.ceil(when[0] * rate_hz - 1e-6), np.floor(when[-1] * rate_hz + 1e-6)
        check_size(count := count + int(last - first + 1))
        frame = np.arange(first, last + 1)
        frame = frame[_is_known(frame / rate_hz, when, x, y)]
        place = [np.interp(frame / rate_hz, when, values) for values in (x, y)]
        parts.append(np.stack([frame, np.full(len(frame), who), *place]))
    return pa.table(dict(zip(("frame", "id", "x", "y"), np.concatenate(parts, axis=1), strict=True)))


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
