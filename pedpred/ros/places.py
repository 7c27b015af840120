"""Whether the places in a bag can be those of people, in metres."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from pedpred.errors import SourceError, ValueRuleError
from pedpred.scenes import Trajectories
from pedpred.sources.plausibility import check_degrees
from pedpred.tables.placeholders import FASTEST_MPS
from pedpred.tables.units import UNITS

_SPAN_S = 0.4
"""Over this time at least, people move farther than detectors err."""


def check_several(people: Trajectories) -> None:
    """Check that not everybody is always at one place, as where a detector fills in another field.

    Raises:
        ValueRuleError: several people are.
    """
    if len(np.unique(people.track_id)) > 1 and not np.ptp(people.position, axis=0).any():
        rule = "everybody is always there: do the messages say in another field where people are?"
        raise ValueRuleError("position", people.position[0].tolist(), rule)


def check_lengths(path: Path, people: Trajectories) -> None:
    """Check that places are in metres, as messages define them.

    Raises:
        ValueRuleError: they look like degrees, or several people are too fast most of the time. One alone may
            be a false detection.
    """
    try:
        check_degrees(path, people)
    except SourceError as cause:
        rule = "it looks like degrees of longitude and latitude: bring people to metres, such as UTM"
        raise ValueRuleError("position", people.position[0].tolist(), rule) from cause
    usual_mps = _usual_speed_mps(people)
    if usual_mps > FASTEST_MPS and len(np.unique(people.track_id)) > 1:
        speed = f"{usual_mps:.3g} m/s half of the time"
        unit = next((unit for unit in ("cm", "mm") if usual_mps * UNITS[unit] < FASTEST_MPS), "another unit")
        doubt = f"are lengths {unit} in place of metres, or times not seconds?"
        rule = f"nobody walks so fast: {doubt} Correct them, or write a table and say its unit (--unit)"
        raise ValueRuleError("position", speed, rule)


def _usual_speed_mps(people: Trajectories) -> float:
    """How fast people move half of the time, m/s; 0 where nobody is seen for long enough to tell."""
    apart = max(1, math.ceil(_SPAN_S / people.usual_interval_s() - 1e-6))
    order = np.lexsort((people.time_s, people.track_id))
    before, after = order[:-apart], order[apart:]
    same = people.track_id[before] == people.track_id[after]
    way_m = np.linalg.norm(people.position[after] - people.position[before], axis=1)[same]
    gap_s = (people.time_s[after] - people.time_s[before])[same]
    return float(np.median(way_m / gap_s)) if same.any() else 0.0
