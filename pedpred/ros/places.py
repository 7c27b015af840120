"""Whether the places in a bag can be those of people, in metres."""

from __future__ import annotations

import logging
import math
from pathlib import Path

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.reading.checks import speeds_mps
from pedpred.ros.placeholders import FASTEST_MPS
from pedpred.scenes import Trajectories
from pedpred.tracking.steps import catch_up

_SPAN_S = 0.4
"""Over this time at least, people move farther than detectors err."""
_DEGREES_PER_S = 2e-4
"""Longitude and latitude of people who walk change by less, degrees/s."""
_METRES = {"cm": 0.01, "mm": 0.001}
_FEWEST_STEPS = 5
_log = logging.getLogger(__name__)


def check_several(people: Trajectories) -> None:
    """Check that not everybody is always at one place, as where a detector fills in another field.

    Raises:
        ValueRuleError: several people are.
    """
    if len(np.unique(people.track_id)) > 1 and not np.ptp(people.position, axis=0).any():
        rule = "everybody is always there: do the messages say in another field where people are?"
        raise ValueRuleError("position", people.position[0].tolist(), rule)


def check_lengths(people: Trajectories) -> None:
    """Check that places are in metres, as messages define them.

    Raises:
        ValueRuleError: they look like degrees, or several people are too fast most of the time. One alone may
            be a false detection.
    """
    speed_mps, largest = speeds_mps(people), np.sort(np.abs(people.position).max(axis=0, initial=0.0))
    slow = len(speed_mps) > 0 and 0.0 < np.percentile(speed_mps, 99) < _DEGREES_PER_S
    if slow and largest[0] <= 90.0 and largest[1] <= 180.0:
        rule = "it looks like degrees of longitude and latitude: bring people to metres, such as UTM"
        raise ValueRuleError("position", people.position[0].tolist(), rule)
    usual_mps = _usual_speed_mps(people)
    if usual_mps > FASTEST_MPS and len(np.unique(people.track_id)) > 1:
        speed = f"{usual_mps:.3g} m/s half of the time"
        unit = next(
            (unit for unit in ("cm", "mm") if usual_mps * _METRES[unit] < FASTEST_MPS), "another unit"
        )
        doubt = f"are lengths {unit} in place of metres, or times not seconds?"
        rule = f"nobody walks so fast: {doubt} Correct them, or write a table and say its unit (--unit)"
        raise ValueRuleError("position", speed, rule)


def warn_of_repeats(path: Path, people: Trajectories) -> None:
    """Warn if most people who move on after standing still catch up in one step."""
    order = np.lexsort((people.time_s, people.track_id))
    same = np.diff(people.track_id[order]) == 0
    gap_s, way_m = (
        np.diff(people.time_s[order]),
        np.linalg.norm(np.diff(people.position[order], axis=0), axis=1),
    )
    stood = np.r_[False, same[:-1] & (way_m[:-1] == 0.0)] & same
    begins, repeats = stood & (way_m > 0.0), catch_up(stood, way_m, gap_s)
    if begins.sum() < _FEWEST_STEPS or 2 * repeats.sum() <= begins.sum():
        return
    text = "%s: %d of %d times that people move on after standing still, they catch up in one step: %s"
    cause = "old positions are repeated under new times, so that forecasts are wrong: write each one once"
    _log.warning(text, path, repeats.sum(), begins.sum(), cause)


def _usual_speed_mps(people: Trajectories) -> float:
    """How fast people move half of the time, m/s; 0 where nobody is seen for long enough to tell."""
    apart = max(1, math.ceil(_SPAN_S / people.usual_interval_s() - 1e-6))
    order = np.lexsort((people.time_s, people.track_id))
    before, after = order[:-apart], order[apart:]
    same = people.track_id[before] == people.track_id[after]
    way_m = np.linalg.norm(people.position[after] - people.position[before], axis=1)[same]
    gap_s = (people.time_s[after] - people.time_s[before])[same]
    return float(np.median(way_m / gap_s)) if same.any() else 0.0
