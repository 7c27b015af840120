"""How far people go along their heading, and how far they are forecast to go, by their present speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.report.document import Cell, Row, Section, Table, Text
from pedpred.report.methods import Method, Methods

SPEEDS_MPS = (0.0, 0.2, 0.5, 1.0, np.inf)
"""Limits of the groups of people."""
FEWEST = 30
"""Windows of a group that is shown."""
TOLERATED_M, TOLERATED_SHARE = 0.1, 0.1
"""A mean forecast is emphasised if it is off by more than both; the second is a share of the true way."""


def displacement_section(
    windows: Mapping[str, Sequence[EvaluationWindows]], methods: Methods
) -> list[Section]:
    """Tabulate the mean way until the last step by present speed: forecasts of starts and stops shift it.

    The learned networks and the reference are shown, as far as they were evaluated, in each test set.
    """
    known = {key for scenes in windows.values() for scene in scenes for key in scene.predictions}
    shown = [row for row in (*methods.networks, methods.reference) if row.key in known]
    rows = [row for place, scenes in windows.items() if scenes for row in _rows(place, scenes, shown)]
    if not rows:
        return []
    text = (
        "Mean way along the heading until the last step of the forecast, of people who have a certain speed "
        f"now. Bold: off by more than {TOLERATED_M} m and by more than {TOLERATED_SHARE:.0%} of the true way."
    )
    header = ["place", "speed now [m/s]", "windows", "true [m]", *(f"{row.label} [m]" for row in shown)]
    return [Section("How far people go", [Text(text), Table(header, rows, texts=2)], "displacement", True)]


def _rows(place: str, scenes: Sequence[EvaluationWindows], shown: Sequence[Method]) -> list[Row]:
    """One row per group of people of a test set."""
    speed = np.concatenate([np.hypot(*scene.velocity.T) for scene in scenes])
    ways = np.concatenate([_ways_m(scene, shown) for scene in scenes], axis=1)
    rows = []
    for low, high in pairwise(SPEEDS_MPS):
        group = (speed >= low) & (speed < high)
        if group.sum() < FEWEST:
            continue
        true_m, *means = (float(way[group].mean()) for way in ways)
        limit_m = max(TOLERATED_M, TOLERATED_SHARE * abs(true_m))
        cells = [Cell(f"{mean:.2f}", strong=abs(mean - true_m) > limit_m) for mean in means]
        speeds = f"{low:g} - {high:g}" if np.isfinite(high) else f"above {low:g}"
        rows.append(Row([Cell(place), Cell(speeds), Cell(str(group.sum())), Cell(f"{true_m:.2f}"), *cells]))
    return rows


def _ways_m(scene: EvaluationWindows, shown: Sequence[Method]) -> np.ndarray:
    """Way along the heading until the last step, the true one and those forecast, m. [1 + methods, W]."""
    heading = np.stack([np.cos(scene.heading_rad), np.sin(scene.heading_rad)], axis=-1)
    paths = [scene.truth, *(scene.predictions[method.key].point for method in shown)]
    ways: np.ndarray = ((np.array(paths)[:, :, -1] - scene.position) * heading).sum(axis=-1)
    return ways
