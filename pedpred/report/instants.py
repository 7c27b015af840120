"""Instants that are shown, chosen by a rule.

The gain of an instant is the mean, over its moving people, of the ADE of the reference method minus that of
the main method. Shown are the instants with the largest and the smallest gain. Ties go to the earlier scene
name and time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.forecasting import Methods
from pedpred.storage.windows import EvaluationWindows

MOVING_MPS = 0.3
"""People faster than this count as moving."""


@dataclass(frozen=True)
class Instant:
    """One instant of a scene.

    Attributes:
        scene: its name.
        time_s: the instant, s.
        rows: its windows. [n] int
        focus: the window of the person in focus.
        who: that person's id.
        caption: what is shown and why.
    """

    scene: str
    time_s: float
    rows: np.ndarray
    focus: int
    who: int
    caption: str = ""

    @property
    def where(self) -> str:
        """Scene and time, as captions begin."""
        return f"Scene {self.scene}, t = {self.time_s:.1f} s"


@dataclass(frozen=True)
class Gain:
    """An instant with the mean gain of its moving people, m, and how many they are."""

    instant: Instant
    gain_m: float
    moving: int

    def captioned(self, least: bool, methods: Methods) -> Instant:
        """Add a caption that says why the instant is shown."""
        caption = (
            f"{self.instant.where}: the instant at which the {methods.main.label}'s gain over the "
            f"{methods.reference.label} is {'smallest' if least else 'largest'}, {self.gain_m:+.3f} m on "
            f"average over {self.moving} moving people."
        )
        return replace(self.instant, caption=caption)


def choose(
    scenes: Mapping[str, EvaluationWindows], least_moving: int, methods: Methods, least: bool = False
) -> Instant:
    """Choose the instant of all scenes with the largest (or smallest) gain.

    Args:
        scenes: windows by scene name.
        least_moving: least number of moving people at the instant; where no instant has as many,
            the largest number that occurs.
        methods: the main one and the reference are compared.
        least: ask for the smallest gain.

    Raises:
        ValueRuleError: no person moves at any time.
    """
    found = [instant for name in sorted(scenes) for instant in _gains(name, scenes[name], least, methods)]
    if not found:
        raise ValueRuleError("scenes", sorted(scenes), "a person must be moving in one of them")
    asked = min(least_moving, max(instant.moving for instant in found))
    crowded = [instant for instant in found if instant.moving >= asked]
    return min(crowded, key=lambda found: found.gain_m if least else -found.gain_m).captioned(least, methods)


def _gains(scene: str, windows: EvaluationWindows, least: bool, methods: Methods) -> list[Gain]:
    """All instants with a moving person, by time."""
    pair = (methods.reference.key, methods.main.key)
    missing = [name for name in pair if name not in windows.predictions]
    if missing:
        rule = f"{missing[0]} must be among them"
        raise ValueRuleError(f"forecasts of {scene}", sorted(windows.predictions), rule)
    gain_m = windows.ade_m(pair[0]) - windows.ade_m(pair[1])
    moving = np.linalg.norm(windows.velocity, axis=-1) > MOVING_MPS
    clock_ms = np.round(windows.time_s * 1000.0).astype(np.int64)
    order = np.argsort(clock_ms, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(clock_ms[order])) + 1)
    found = []
    for rows in groups:
        walkers = rows[moving[rows]]
        if len(walkers):
            focus = int(walkers[np.argmin(gain_m[walkers]) if least else np.argmax(gain_m[walkers])])
            instant = Instant(scene, float(windows.time_s[focus]), rows, focus, int(windows.track_id[focus]))
            found.append(Gain(instant, float(gain_m[walkers].mean()), len(walkers)))
    return found
