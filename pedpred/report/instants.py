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
    """One instant of a scene."""

    scene: str  # its name
    time_s: float  # the instant, s
    rows: np.ndarray  # its windows. [n] int
    focus: int  # the window of the person in focus
    who: int  # that person's id
    caption: str = ""  # what is shown and why

    @classmethod
    def of(cls, scene: str, windows: EvaluationWindows, focus: int) -> Instant:
        """The instant of a window, with all windows at that time."""
        rows = np.flatnonzero(np.abs(windows.time_s - windows.time_s[focus]) < 5e-4)
        return cls(scene, float(windows.time_s[focus]), rows, focus, int(windows.track_id[focus]))

    @property
    def where(self) -> str:
        """Scene and time, as captions begin."""
        return f"Scene {self.scene}, t = {self.time_s:.1f} s"


def moving(windows: EvaluationWindows) -> np.ndarray:
    """Which windows are of moving people. [W] bool."""
    return np.linalg.norm(windows.velocity, axis=-1) > MOVING_MPS


def walkers_by_instant(windows: EvaluationWindows) -> list[np.ndarray]:
    """The windows of moving people, one array of rows per instant, by time."""
    clock_ms = np.round(windows.time_s * 1000.0).astype(np.int64)
    walkers = np.flatnonzero(moving(windows))
    walkers = walkers[np.argsort(clock_ms[walkers], kind="stable")]
    groups = np.split(walkers, np.flatnonzero(np.diff(clock_ms[walkers])) + 1)
    return [rows for rows in groups if len(rows)]


def choose(
    scenes: Mapping[str, EvaluationWindows], least_moving: int, methods: Methods, least: bool = False
) -> Instant:
    """Choose the instant of all scenes with the largest (or `least`) gain of the main method.

    At least `least_moving` people move then; where no instant has as many, the largest number that occurs.

    Raises:
        ValueRuleError: no person moves at any time, or one of the two methods has no forecasts.
    """
    sign = -1.0 if least else 1.0
    found = []
    for name in sorted(scenes):
        gain_m = sign * _gain_m(name, scenes[name], methods)
        for rows in walkers_by_instant(scenes[name]):
            found.append((float(gain_m[rows].mean()), len(rows), name, int(rows[np.argmax(gain_m[rows])])))
    if not found:
        raise ValueRuleError("scenes", sorted(scenes), "a person must be moving in one of them")
    asked = min(least_moving, max(count for _, count, _, _ in found))
    crowded = [candidate for candidate in found if candidate[1] >= asked]
    gain, count, name, focus = max(crowded, key=lambda candidate: candidate[0])
    instant = Instant.of(name, scenes[name], focus)
    caption = (
        f"{instant.where}: the instant at which the {methods.main.label}'s gain over the "
        f"{methods.reference.label} is {'smallest' if least else 'largest'}, {sign * gain + 0.0:+.3f} m on "
        f"average over {count} moving people."
    )
    return replace(instant, caption=caption)


def _gain_m(scene: str, windows: EvaluationWindows, methods: Methods) -> np.ndarray:
    """ADE of the reference minus that of the main method. [W]."""
    for method in (methods.reference, methods.main):
        if method.key not in windows.predictions:
            rule = f"{method.key} must be among them"
            raise ValueRuleError(f"forecasts of {scene}", sorted(windows.predictions), rule)
    return windows.ade_m(methods.reference.key) - windows.ade_m(methods.main.key)
