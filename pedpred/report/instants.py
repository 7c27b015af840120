"""Instants that are shown, chosen by rules.

The gain of an instant is the mean, over its moving people, of the ADE of the reference method minus that of
the main method. Shown are the instants with the largest and the smallest gain, and two encounters: two people
give way to each other, one turns or stops before an obstacle. For these the rule is: of all windows of moving
people, those whose straight continuation by the reference method goes most wrong although the true path was
safe. Ties go to the earlier scene name and time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import distance_transform_edt

from pedpred.errors import ValueRuleError
from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.report.methods import Method, Methods
from pedpred.scenes import OccupancyMap, Scene

MOVING_MPS = 0.3
"""People faster than this count as moving."""
APART_M = (0.6, 1.5)
"""True minimum distance of two people who avoid each other: passing by, not touching, m."""
FACING_DEG = 120.0
"""The least angle between the velocities of two people who walk towards each other, degrees."""


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


def is_moving(windows: EvaluationWindows) -> np.ndarray:
    """Which windows are of moving people. [W] bool."""
    return np.linalg.norm(windows.velocity, axis=-1) > MOVING_MPS


def walkers_by_instant(windows: EvaluationWindows) -> list[np.ndarray]:
    """The windows of moving people, one array of rows per instant, by time."""
    clock_ms = np.round(windows.time_s * 1000.0).astype(np.int64)
    walkers = np.flatnonzero(is_moving(windows))
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
    chosen = []
    for name in sorted(scenes):
        gain_m = sign * _gain_m(name, scenes[name], methods)
        for rows in walkers_by_instant(scenes[name]):
            chosen.append((float(gain_m[rows].mean()), len(rows), name, int(rows[np.argmax(gain_m[rows])])))
    if not chosen:
        raise ValueRuleError("scenes", sorted(scenes), "a person must be moving in one of them")
    asked = min(least_moving, max(count for _, count, _, _ in chosen))
    crowded = [candidate for candidate in chosen if candidate[1] >= asked]
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


def mutual_avoidance(scenes: Mapping[str, EvaluationWindows], reference: Method) -> Instant | None:
    """Find two people who walk towards each other, pass, and make most room compared with the forecast.

    In focus is one of the two; the earlier scene name and time wins a tie. None where there is no such pair.
    """
    meetings = [meeting for name in sorted(scenes) for meeting in _meetings(name, scenes[name], reference)]
    if not meetings:
        return None
    straight_m, true_m, other, instant = min(meetings, key=lambda meeting: meeting[0] - meeting[1])
    caption = (
        f"{instant.where}: mutual avoidance. Of all pairs who walk towards each other and pass at "
        f"{APART_M[0]} to {APART_M[1]} m, the pair that makes most room. People {instant.who} and {other}: "
        f"minimum distance forecast by {reference.label} {straight_m:.2f} m, actual {true_m:.2f} m."
    )
    return replace(instant, caption=caption)


def before_obstacle(
    scenes: Mapping[str, EvaluationWindows], places: Mapping[str, Scene], reference: Method
) -> Instant | None:
    """Find the moving person whose forecast goes deepest into an obstacle that the true path avoids."""
    deepest, best = 0.0, None
    for name in sorted(scenes):
        windows, occupancy = scenes[name], places[name].occupancy
        ahead_m = depth_m(windows.predictions[reference.key].point, occupancy).max(axis=1, initial=0.0)
        safe = ~occupancy.is_occupied(windows.truth).any(axis=1) & ~occupancy.is_occupied(windows.position)
        ahead_m = np.where(safe & is_moving(windows), ahead_m, 0.0)
        row = int(np.argmax(ahead_m)) if len(windows) else 0
        if len(windows) and ahead_m[row] > deepest:
            deepest, best = ahead_m[row], Instant.of(name, windows, row)
    if best is None:
        return None
    caption = (
        f"{best.where}: a stop or a turn before an obstacle. Of all people who did not enter an obstacle, "
        f"the {reference.label} forecast of person {best.who} goes deepest into one, {deepest:.2f} m."
    )
    return replace(best, caption=caption)


def depth_m(points: np.ndarray, occupancy: OccupancyMap) -> np.ndarray:
    """Distance of points (world, m, [..., 2]) in obstacles to the nearest free cell, 0 if free, m. [...]."""
    depth = distance_transform_edt(occupancy.occupied) * occupancy.resolution_m
    at = np.clip(occupancy.cell_of(points), 0, np.array(depth.shape) - 1)
    return np.where(occupancy.is_occupied(points), depth[at[..., 0], at[..., 1]], 0.0)


def _meetings(
    scene: str, windows: EvaluationWindows, reference: Method
) -> list[tuple[float, float, int, Instant]]:
    """The best meeting of each instant: forecast and actual minimum distance, m; the other's id."""
    meetings = []
    for rows in walkers_by_instant(windows):
        one, two = (rows[side] for side in np.triu_indices(len(rows), 1))
        straight_m = _nearest_m(windows.predictions[reference.key].point, one, two)
        true_m = _nearest_m(windows.truth, one, two)
        fits = _facing(windows, one, two) & (true_m >= APART_M[0]) & (true_m <= APART_M[1])
        if fits.any():
            k = int(np.argmin(np.where(fits, straight_m - true_m, np.inf)))
            instant = Instant.of(scene, windows, int(one[k]))
            meetings.append((float(straight_m[k]), float(true_m[k]), int(windows.track_id[two[k]]), instant))
    return meetings


def _facing(windows: EvaluationWindows, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Whether people ([Q] rows each) walk in opposite directions and come nearer to each other. [Q] bool."""
    velocity = windows.world_velocity
    speeds = np.linalg.norm(velocity[one], axis=-1) * np.linalg.norm(velocity[two], axis=-1)
    opposite = (velocity[one] * velocity[two]).sum(axis=-1) < np.cos(np.deg2rad(FACING_DEG)) * speeds
    between = windows.position[two] - windows.position[one]
    return opposite & (((velocity[two] - velocity[one]) * between).sum(axis=-1) < 0)


def _nearest_m(paths: np.ndarray, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """The least distance over the steps of pairs of paths, m: [Q]."""
    return np.linalg.norm(paths[one] - paths[two], axis=-1).min(axis=-1)
