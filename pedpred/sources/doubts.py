"""Warnings about tracks that can be those of people, but hardly are what the file means."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from pedpred.errors import worded
from pedpred.scenes import Trajectories
from pedpred.sources.plausibility import USUAL_MPS, WALK_MPS, begin_of, speeds_mps

_log = logging.getLogger(__name__)
_CRAWL_MPS = 0.3
"""Nobody is as slow all the time."""
_FEWEST_TRACKS = 3
_BODY_M = 0.25
"""Two people are not in the same square of this side."""
_COARSE_M = (1.0, 0.5, 0.25)
_FEWEST_ROWS, _FEWEST_VALUES = 100, 5
"""Fewer detections, or different values of x or y, may be multiples of such steps by chance."""


def doubt_fractions(path: Path, people: Trajectories) -> None:
    """Warn about people who all are within one metre, as where positions are parts of a picture.

    Args:
        path: the file, for messages.
        people: what was read from it, taken as metres and seconds.
    """
    if len(people) and people.position.min() >= 0.0 and people.position.max() <= 1.0:
        text = "%s: all positions lie from 0 to 1: are they parts of a picture's width and height? %s"
        remedy = worded("make pixels of them, and give --scale or --homography", "bring them to metres first")
        _log.warning(text, path, f"Then {remedy}")


def doubt_starts(path: Path, people: Trajectories) -> None:
    """Warn if all tracks begin at the origin, or at one time and people are where others are at that time.

    This is so where positions or times are relative to the first detection of each person.

    Args:
        path: the file, for messages.
        people: what was read from it.
    """
    people = begin_of(people)
    ids, first = np.unique(people.track_id, return_index=True)  # rows are in order of time
    if len(ids) < _FEWEST_TRACKS:
        return
    if not people.position[first].any():
        text = "%s: all %d tracks begin at (0, 0): are positions relative to the first one of each person?"
        _log.warning(text, path, len(ids))
    if np.ptp(people.time_s[first]):
        return
    places = np.column_stack([people.time_s, np.floor(people.position / _BODY_M)])
    if together := len(places) - len(np.unique(places, axis=0)):
        text = "%s: all %d tracks begin at %.10g s, and people are %d times where another person is: %s"
        ask = "are times counted from the first detection of each person? Then add these first times"
        _log.warning(text, path, len(ids), people.time_s[0], together, ask)


def doubt_rate(path: Path, people: Trajectories, rate_hz: float, by_caller: bool) -> None:
    """Warn if people hardly walk, and would if the rate were that of the frames that are there.

    Args:
        path: the file, for messages.
        people: what was read from it.
        rate_hz: frames per second, by which frame numbers were divided.
        by_caller: whether the caller has said it, and not the file.
    """
    frames = np.unique(np.rint(people.time_s * rate_hz).astype(np.int64))
    every, speed_mps = int(np.gcd.reduce(np.diff(frames))) if len(frames) > 1 else 1, speeds_mps(people)
    usual_mps = float(np.percentile(speed_mps, 99)) if len(speed_mps) else np.inf
    if every > 1 and usual_mps < _CRAWL_MPS and WALK_MPS < every * usual_mps <= USUAL_MPS:
        text = (
            "%s: frame numbers are multiples of %d: at %g frames per second people move at up to %.2g m/s; %s"
        )
        right = f"{every * rate_hz:g}"
        say = (
            f"say {worded(f'--rate {right}', f'rate_hz={right}')}" if by_caller else f"correct it to {right}"
        )
        instead = f"if there are {rate_hz:g} of these per second, {say}: {every * usual_mps:.2g} m/s"
        _log.warning(text, path, every, rate_hz, usual_mps, instead)


def doubt_digits(path: Path, people: Trajectories) -> None:
    """Warn if positions along an axis are multiples of a step that is long for people.

    Args:
        path: the file, for messages.
        people: what was read from it, taken as metres and seconds.
    """
    people = begin_of(people)
    if len(people) < _FEWEST_ROWS:
        return
    for title, values in zip("xy", people.position.T, strict=True):
        steps_m = [
            step_m for step_m in _COARSE_M if np.array_equal(np.rint(values / step_m) * step_m, values)
        ]
        if steps_m and len(np.unique(values)) >= _FEWEST_VALUES:
            text = "%s: all %s are multiples of %g m: %s"
            ask = "were digits lost, as in numbers of 32 bits, or are they cells or pixels?"
            _log.warning(text, path, title, steps_m[0], ask)
            return
