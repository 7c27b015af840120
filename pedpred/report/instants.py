"""Instants that are shown, chosen by rules: each shows the candidate with the highest score.

Ties go to the earlier scene name and time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.ndimage import distance_transform_edt

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.report.methods import Methods
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
    def of(cls, scene: str, windows: EvaluationWindows, focus: int, caption: str = "") -> Instant:
        """The instant of a window, with all windows at that time."""
        time_s = float(windows.time_s[focus])
        rows = np.flatnonzero(np.abs(windows.time_s - time_s) < 5e-4)
        who = int(windows.track_id[focus])
        return cls(scene, time_s, rows, focus, who, f"Scene {scene}, t = {time_s:.1f} s{caption}")


class Candidate(NamedTuple):
    """An instant that a rule may choose."""

    score: float
    focus: int  # the window of the person in focus
    people: int  # who move
    facts: Mapping[str, float]  # of the caption


class Rule(NamedTuple):
    """How an instant is chosen."""

    candidates: Callable[[EvaluationWindows, Scene, Methods], Iterator[Candidate]]  # of a scene, by time
    caption: str  # a template of {main}, {reference}, {who}, {people} and the facts of the candidate
    crowded: bool = False  # only instants with many moving people are candidates


def choose(
    rule: Rule,
    windows: Mapping[str, EvaluationWindows],
    scenes: Mapping[str, Scene],
    least_moving: int,
    methods: Methods,
) -> Instant | None:
    """Choose an instant of some scenes; None without a candidate.

    Args:
        rule: that decides.
        windows: by scene.
        scenes: by name.
        least_moving: people who move at an instant of a crowd; where no instant has as many, the largest
            number that occurs.
        methods: the main and the reference method are compared.
    """
    every = [
        (name, one)
        for name in sorted(windows)
        for one in rule.candidates(windows[name], scenes[name], methods)
    ]
    if not every:
        return None
    asked = min(least_moving, max(one.people for _, one in every)) if rule.crowded else 0
    name, best = max((pair for pair in every if pair[1].people >= asked), key=lambda pair: pair[1].score)
    names = {"main": methods.main.label, "reference": methods.reference.label}
    who = windows[name].track_id[best.focus]
    caption = rule.caption.format(**names, who=who, people=best.people, **best.facts)
    return Instant.of(name, windows[name], best.focus, f": {caption}")


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


def gains(sign: float, windows: EvaluationWindows, scene: Scene, methods: Methods) -> Iterator[Candidate]:
    """Instants by the mean gain of the main method over the reference, the difference of their ADE."""
    gain_m = sign * (windows.ade_m(methods.reference.key) - windows.ade_m(methods.main.key))
    for rows in walkers_by_instant(windows):
        score = float(gain_m[rows].mean())
        facts = {"gain_m": sign * score + 0.0}
        yield Candidate(score, int(rows[np.argmax(gain_m[rows])]), len(rows), facts)


def meetings(windows: EvaluationWindows, scene: Scene, methods: Methods) -> Iterator[Candidate]:
    """The pair of each instant who walk towards each other, pass, and make most room."""
    point = windows.predictions[methods.reference.key].point
    for rows in walkers_by_instant(windows):
        one, two = (rows[side] for side in np.triu_indices(len(rows), 1))
        straight_m, true_m = (_nearest_m(paths, one, two) for paths in (point, windows.truth))
        fits = _facing(windows, one, two) & (true_m >= APART_M[0]) & (true_m <= APART_M[1])
        if fits.any():
            k = int(np.argmin(np.where(fits, straight_m - true_m, np.inf)))
            facts = {"straight_m": straight_m[k], "true_m": true_m[k], "other": windows.track_id[two[k]]}
            yield Candidate(float(true_m[k] - straight_m[k]), int(one[k]), len(rows), facts)


def stops(windows: EvaluationWindows, scene: Scene, methods: Methods) -> Iterator[Candidate]:
    """The moving person whose forecast goes deepest into an obstacle that the true path avoids."""
    if not len(windows):
        return
    occupancy, point = scene.occupancy, windows.predictions[methods.reference.key].point
    depths_m = depth_m(point, occupancy).max(axis=1, initial=0.0)
    safe = ~occupancy.is_occupied(windows.truth).any(axis=1) & ~occupancy.is_occupied(windows.position)
    depths_m = np.where(safe & is_moving(windows), depths_m, 0.0)
    row = int(np.argmax(depths_m))
    if depths_m[row] > 0:
        yield Candidate(depths_m[row], row, 1, {"depth_m": depths_m[row]})


def depth_m(points: np.ndarray, occupancy: OccupancyMap) -> np.ndarray:
    """Distance of points (world, m, [..., 2]) in obstacles to the nearest free cell, 0 if free, m. [...]."""
    depth = distance_transform_edt(occupancy.occupied) * occupancy.resolution_m
    at = np.clip(occupancy.cell_of(points), 0, np.array(depth.shape) - 1)
    return np.where(occupancy.is_occupied(points), depth[at[..., 0], at[..., 1]], 0.0)


def _facing(windows: EvaluationWindows, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Whether people ([Q] rows each) walk in opposite directions and come nearer to each other. [Q] bool."""
    mine, theirs = (windows.world_velocity[rows] for rows in (one, two))
    between = windows.position[two] - windows.position[one]
    speeds = np.linalg.norm(mine, axis=-1) * np.linalg.norm(theirs, axis=-1)
    opposite = (mine * theirs).sum(axis=-1) < np.cos(np.deg2rad(FACING_DEG)) * speeds
    return opposite & (((theirs - mine) * between).sum(axis=-1) < 0)


def _nearest_m(paths: np.ndarray, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """The least distance over the steps of pairs of paths, m: [Q]."""
    return np.linalg.norm(paths[one] - paths[two], axis=-1).min(axis=-1)


_GAIN = (
    "the instant at which the {{main}}'s gain over the {{reference}} is {which}, {{gain_m:+.3f}} m on "
    "average over {{people}} moving people."
)
RULES = {
    "gain": Rule(partial(gains, 1.0), _GAIN.format(which="largest"), crowded=True),
    "loss": Rule(partial(gains, -1.0), _GAIN.format(which="smallest"), crowded=True),
    "avoidance": Rule(
        meetings,
        "mutual avoidance. Of all pairs who walk towards each other and pass at "
        f"{APART_M[0]} to {APART_M[1]} m, the pair that makes most room. People {{who}} and {{other}}: "
        "minimum distance forecast by {reference} {straight_m:.2f} m, actual {true_m:.2f} m.",
    ),
    "obstacle": Rule(
        stops,
        "a stop or a turn before an obstacle. Of all people who did not enter an obstacle, the {reference} "
        "forecast of person {who} goes deepest into one, {depth_m:.2f} m.",
    ),
}
"""What is shown of a place, by the ending of the picture's name."""
