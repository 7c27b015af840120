"""Which instants are shown: chosen by a rule, not by hand.

At every instant with enough moving people, the gain is the mean over them of how much closer the
model is to the truth than the yardstick. Shown are the instant with the largest gain and, for
balance, the one with the smallest. Ties go to the earlier scene name and time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.report.methods import MODEL, YARDSTICK, label
from pedpred.storage.windows import Windows

MOVING_MPS = 0.3
"""People faster than this count as moving."""


@dataclass(frozen=True)
class Instant:
    """One instant of a scene.

    Attributes:
        scene: its name.
        time_s: the instant, s.
        rows: its windows. [n] int
        focus: the window of the moving person who gains (or loses) most.
        gain_m: mean gain of the moving people, m.
        moving: how many they are.
    """

    scene: str
    time_s: float
    rows: np.ndarray
    focus: int
    gain_m: float
    moving: int

    def caption(self, least: bool) -> str:
        """What is shown and why."""
        which = "smallest" if least else "largest"
        return (
            f"Scene {self.scene}, t = {self.time_s:.1f} s: the instant at which the {label(MODEL)}'s gain "
            f"over the {label(YARDSTICK)} is {which}, {self.gain_m:+.3f} m on average over {self.moving} "
            "moving people."
        )


def choose(scenes: Mapping[str, Windows], least_moving: int, least: bool = False) -> Instant:
    """The instant of all scenes at which the model gains most (or least) over the yardstick.

    Args:
        scenes: windows by scene name.
        least_moving: how many people must be moving at the instant; where no instant has as many,
            the largest number that occurs is asked for instead.
        least: ask for the smallest gain.

    Raises:
        ValueRuleError: nobody moves at any time.
    """
    found = [instant for name in sorted(scenes) for instant in _instants(name, scenes[name], least)]
    if not found:
        raise ValueRuleError("scenes", sorted(scenes), "somebody must be moving in one of them")
    asked = min(least_moving, max(instant.moving for instant in found))
    crowded = [instant for instant in found if instant.moving >= asked]
    return min(crowded, key=lambda instant: instant.gain_m if least else -instant.gain_m)


def _instants(scene: str, windows: Windows, least: bool) -> list[Instant]:
    """All instants at which somebody moves, by time."""
    missing = [name for name in (YARDSTICK, MODEL) if name not in windows.paths]
    if missing:
        rule = f"{missing[0]} must be among them"
        raise ValueRuleError(f"forecasts of {scene}", sorted(windows.paths), rule)
    gain_m = windows.ade_m(YARDSTICK) - windows.ade_m(MODEL)
    moving = np.linalg.norm(windows.velocity, axis=-1) > MOVING_MPS
    clock_ms = np.round(windows.time_s * 1000.0).astype(np.int64)
    order = np.argsort(clock_ms, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(clock_ms[order])) + 1)
    found = []
    for rows in groups:
        walkers = rows[moving[rows]]
        if len(walkers):
            focus = walkers[np.argmin(gain_m[walkers]) if least else np.argmax(gain_m[walkers])]
            time_s, mean_m = float(windows.time_s[rows[0]]), float(gain_m[walkers].mean())
            found.append(Instant(scene, time_s, rows, int(focus), mean_m, len(walkers)))
    return found
