"""A stretch of a scene for the page's player: what was seen and what was forecast.

Lengths are whole millimetres from the lower left corner of the map, times hundredths of a second from the
beginning of the stretch, headings tenths of a milliradian, speeds cm/s. Everything is turned like the scene's
camera picture, as in the plans of the report. Points of true and forecast paths are exact to half of
`PATH_MM`, those of modes to half of `MODE_MM`. Numbers are JSON, compressed by gzip, in base 64; `replay.js`
reads them.
"""

from __future__ import annotations

import base64
import gzip
import json
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.report.animation import LONGEST_GAP, busiest_start
from pedpred.report.methods import Methods
from pedpred.report.plan import obstacle_image, quarter_turns_of, turn_points
from pedpred.scenes import Predictions, Scene
from pedpred.settings import In, Settings

TAIL_S = 2.0
"""Time before the stretch for which detections are kept, s."""
PATH_MM, MODE_MM = 10, 50
"""Steps of the points of true paths and point forecasts, and of modes, which are drawn as lines, mm."""
WEIGHT = 0.05
"""Weights of modes are whole multiples of this."""


@dataclass(frozen=True)
class ReplaySettings(Settings):
    """What is kept of each scene.

    Attributes:
        methods: keys of those whose forecasts are kept beside the main method's, where they were evaluated.
        duration_s: of the stretch, which holds most forecasts.
        modes: the most likely ones of each forecast that are kept.
        least_weight: less likely modes are left out, too.
    """

    methods: tuple[str, ...]
    duration_s: Annotated[float, In("(0, 36000]")]
    modes: Annotated[int, In("[1, 1000]")]
    least_weight: Annotated[float, In("[0, 1]")]


@dataclass(frozen=True)
class Replay:
    """The player's data."""

    header: dict[str, Any]  # names, sizes and units
    data: str  # everything else


def replay(scene: Scene, windows: EvaluationWindows, settings: ReplaySettings, methods: Methods) -> Replay:
    """Pack the stretch of a scene that holds most forecasts.

    Raises:
        ValueRuleError: there are no forecasts, or a value is too large.
    """
    shown = methods.ordered(windows.predictions.keys() & {*settings.methods, methods.main.key})
    several = [name for name in shown if windows.predictions[name].modes > 1]
    stretch, seen = _Stretch(scene, windows, settings.duration_s), scene.trajectories
    rows, horizon_s = stretch.rows, windows.truth.shape[1] * windows.dt_s
    kept = stretch.kept(seen.track_id, seen.time_s, -TAIL_S, stretch.duration_s + horizon_s)
    heading = windows.heading_rad[rows] + stretch.turns * np.pi / 2
    data = {
        "map": stretch.image.ravel().astype(int).tolist(),
        "seen": stretch.numbers(seen.track_id[kept], seen.time_s[kept], stretch.plan_mm(seen.position[kept])),
        "rows": stretch.numbers(windows.track_id[rows], windows.time_s[rows], stretch.at_mm),
        "heading": np.rint(1e4 * np.angle(np.exp(1j * heading))).astype(int).tolist(),
        "speed": np.rint(100.0 * np.hypot(*windows.velocity[rows].T)).astype(int).tolist(),
        "paths": {"truth": stretch.bends(windows.truth, PATH_MM)}
        | {name: stretch.bends(windows.predictions[name].point, PATH_MM) for name in shown},
        "modes": {name: stretch.modes(windows.predictions[name], settings) for name in several},
    }
    header = {
        "name": scene.name,
        "start_s": round(stretch.start_s, 2),
        "duration_s": stretch.duration_s,
        "step_s": windows.dt_s,
        "steps": windows.truth.shape[1],
        "gap_s": round(LONGEST_GAP * scene.detection_dt_s, 3),
        "hold_s": round(LONGEST_GAP * max(scene.detection_dt_s, _forecast_dt_s(windows)), 3),
        "tail_s": TAIL_S,
        "size_m": [round(side, 3) for side in stretch.size],
        "map_cells": stretch.image.T.shape,
        "cell_m": windows.grid_resolution_m,
        "grid_cells": windows.grid_cells,
        "cones": windows.angular_grid_m.shape[1],
        "range_m": windows.max_range_m,
        "path_mm": PATH_MM,
        "mode_mm": MODE_MM,
        "weight": WEIGHT,
        "methods": shown,
        "modes": several,
        "drawn": methods.main.key,
    }
    text = json.dumps(data, separators=(",", ":")).encode()
    return Replay(header, base64.b64encode(gzip.compress(text, mtime=0)).decode())


class _Stretch:
    """The part of a scene that is kept, turned and moved into the plan."""

    def __init__(self, scene: Scene, windows: EvaluationWindows, longest_s: float):
        self.turns = quarter_turns_of(scene.camera)
        self.image, (left, right, bottom, top) = obstacle_image(scene.occupancy, self.turns)
        self.corner, self.size = np.array([left, bottom]), (right - left, top - bottom)
        self.start_s = busiest_start(windows.time_s, longest_s)
        self.duration_s = round(min(longest_s, float(windows.time_s.max()) - self.start_s), 2)
        self.rows = self.kept(windows.track_id, windows.time_s, 0.0, self.duration_s)
        self.at_mm = np.rint(self.plan_mm(windows.position[self.rows]))

    def kept(self, track_id: np.ndarray, time_s: np.ndarray, begin_s: float, end_s: float) -> np.ndarray:
        """Rows between two times after the beginning, sorted by track and time."""
        order = np.lexsort((time_s, track_id))
        since_s = time_s[order] - self.start_s
        return order[(since_s >= begin_s - 1e-6) & (since_s <= end_s + 1e-6)]

    def plan_mm(self, points: np.ndarray) -> np.ndarray:
        """World points (m, [..., 2]) in the plan."""
        return 1000.0 * (turn_points(points, self.turns) - self.corner)

    def numbers(self, track_id: np.ndarray, time_s: np.ndarray, at_mm: np.ndarray) -> dict[str, list[int]]:
        """Tracks, times and positions as differences of neighbouring whole numbers; the first one's to 0."""
        clock = 100.0 * (time_s - self.start_s)
        values = {"track": track_id, "clock": clock, "x": at_mm[:, 0], "y": at_mm[:, 1]}
        return {n: np.diff(np.rint(v).astype(np.int64), prepend=0).tolist() for n, v in values.items()}

    def bends(self, paths: np.ndarray, step_mm: int, shown: np.ndarray | None = None) -> list[Any]:
        """Second differences of the points of paths (m, [W, P, 2]) from the present on, in steps. [2][P][R].

        A path that goes straight on at one speed has only its first point; the others are 0, as are all of
        paths that are not shown.
        """
        points = np.rint((self.plan_mm(paths[self.rows]) - self.at_mm[:, None]) / step_mm).astype(int)
        if shown is not None:
            points[~shown] = 0
        return np.diff(points, 2, axis=1, prepend=np.zeros((len(points), 2, 2), int)).T.tolist()

    def modes(self, predictions: Predictions, settings: ReplaySettings) -> list[dict[str, list[Any]]]:
        """Weights of the likely modes of a method, 0 for others, and their paths."""
        weight = predictions.weight[self.rows, : settings.modes]
        parts = np.where(weight < settings.least_weight, 0, np.rint(weight / WEIGHT)).astype(int)
        return [
            {"parts": own.tolist(), "bends": self.bends(predictions.path[:, mode], MODE_MM, own > 0)}
            for mode, own in enumerate(parts.T)
        ]


def _forecast_dt_s(windows: EvaluationWindows) -> float:
    """Usual time between two instants with forecasts, s; longer than between detections behind a sensor."""
    between = np.diff(np.unique(windows.time_s))
    return float(np.quantile(between, 0.25)) if len(between) else 0.0
