"""A stretch of a scene for the page's player: what was seen, what was forecast and what the network saw.

Lengths are whole millimetres from the lower left corner of the map, times hundredths of a second from the
beginning of the stretch, headings tenths of a milliradian. Everything is turned like the scene's camera
picture, as in the plans of the report. Points of true and forecast paths are exact to half of `PATH_MM`,
those of modes to half of `MODE_MM`. The network's inputs are computed from map and positions, here as in the
player (`replay.js`), and the differences to the true inputs are stored: the player shows every bit of the
obstacle grid, and the angular grid in steps of its range / `LEVELS`. Numbers are JSON, compressed by gzip, in
base 64.
"""

from __future__ import annotations

import base64
import gzip
import json
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.models.lstm.features.grids import angular_grids, occupancy_crops
from pedpred.report.animation import LONGEST_GAP, busiest_start
from pedpred.report.methods import Methods
from pedpred.report.plan import obstacle_image, quarter_turns_of, turn_points
from pedpred.scenes import OccupancyMap, Predictions, Scene
from pedpred.settings import In, Settings

TAIL_S = 2.0
"""Time before the stretch for which detections are kept, s."""
PATH_MM, MODE_MM = 10, 50
"""Steps of the points of true paths and point forecasts, and of modes, which are drawn as lines, mm."""
WEIGHT = 0.05
"""Weights of modes are whole multiples of this."""
LEVELS = 240
"""Distances of the angular grid are whole multiples of its range / `LEVELS`, 2.5 cm of 6 m."""
_UNITS: dict[str, Any] = {"path_mm": PATH_MM, "mode_mm": MODE_MM, "weight": WEIGHT, "levels": LEVELS}
_UNITS |= {"tail_s": TAIL_S}


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
    data: str  # everything else, see `pack`


def replay(scene: Scene, windows: EvaluationWindows, settings: ReplaySettings, methods: Methods) -> Replay:
    """Pack the stretch of a scene that holds most forecasts.

    Raises:
        ValueRuleError: there are no forecasts, or a value is too large.
    """
    start_s = busiest_start(windows.time_s, settings.duration_s)
    duration_s = round(min(settings.duration_s, float(windows.time_s.max()) - start_s), 2)
    kept = windows.predictions.keys() & {*settings.methods, methods.main.key}
    shown, steps = methods.ordered(kept), windows.truth.shape[1]
    several = [name for name in shown if windows.predictions[name].modes > 1]
    turns = quarter_turns_of(scene.camera)
    image, (left, right, bottom, top) = obstacle_image(scene.occupancy, turns)
    ground = OccupancyMap(image.T, np.zeros(2), scene.occupancy.resolution_m)
    stretch = _Stretch(scene, windows, start_s, duration_s, turns, np.array([left, bottom]))
    data = {
        "map": image.ravel().astype(int).tolist(),
        "seen": stretch.seen.numbers(),
        "rows": stretch.rows.numbers() | stretch.motion(),
        "paths": stretch.paths(shown),
        "modes": {name: stretch.modes(windows.predictions[name], settings) for name in several},
        "missed": stretch.missed(ground),
    }
    header = _UNITS | {
        "name": scene.name,
        "start_s": round(start_s, 2),
        "duration_s": duration_s,
        "step_s": windows.dt_s,
        "steps": steps,
        "gap_s": round(LONGEST_GAP * scene.detection_dt_s, 3),
        "hold_s": round(LONGEST_GAP * max(scene.detection_dt_s, _forecast_dt_s(windows)), 3),
        "size_m": [round(right - left, 3), round(top - bottom, 3)],
        "map_cells": ground.occupied.shape,
        "map_cell_m": ground.resolution_m,
        "cell_m": windows.grid_resolution_m,
        "grid_cells": windows.grid_cells,
        "cones": windows.angular_grid_m.shape[1],
        "range_m": windows.max_range_m,
        "methods": shown,
        "modes": several,
        "drawn": methods.main.key,
    }
    return Replay(header, pack(data))


def _forecast_dt_s(windows: EvaluationWindows) -> float:
    """Usual time between two instants with forecasts, s; longer than between detections behind a sensor."""
    between = np.diff(np.unique(windows.time_s))
    return float(np.quantile(between, 0.25)) if len(between) else 0.0


def pack(data: dict[str, Any]) -> str:
    """Compress lists of numbers and their names; the same ones give the same text."""
    text = json.dumps(data, separators=(",", ":")).encode()
    return base64.b64encode(gzip.compress(text, mtime=0)).decode()


class _Tracks:
    """Rows of people, sorted by track and time."""

    def __init__(self, track: np.ndarray, clock: np.ndarray, at: np.ndarray):
        """Tracks and times in hundredths of a second, [N] int; positions, mm, [N, 2] int."""
        self.track, self.clock, self.at = track, clock, at
        self.key = track * 2**32 + clock

    def numbers(self) -> dict[str, list[Any]]:
        """Differences of neighbouring rows; the first row's to 0."""
        values = {"track": self.track, "clock": self.clock, "x": self.at[:, 0], "y": self.at[:, 1]}
        return {name: np.diff(series, prepend=0).tolist() for name, series in values.items()}


class _Stretch:
    """The part of a scene that is kept, turned and moved into the plan."""

    def __init__(
        self,
        scene: Scene,
        windows: EvaluationWindows,
        start_s: float,
        duration_s: float,
        turns: int,
        corner: np.ndarray,
    ):
        self.windows, self.start_s, self.turns, self.corner = windows, start_s, turns, corner
        seen, end_s = scene.trajectories, start_s + duration_s
        last_s = end_s + windows.truth.shape[1] * windows.dt_s
        order = np.lexsort((seen.time_s, seen.track_id))
        order = order[(seen.time_s[order] >= start_s - TAIL_S) & (seen.time_s[order] <= last_s)]
        self.seen = self._tracks(seen.track_id[order], seen.time_s[order], seen.position[order])
        order = np.lexsort((windows.time_s, windows.track_id))
        self.kept = order[(windows.time_s[order] >= start_s) & (windows.time_s[order] <= end_s)]
        where = (windows.track_id[self.kept], windows.time_s[self.kept], windows.position[self.kept])
        self.rows = self._tracks(*where)
        heading = windows.heading_rad[self.kept] + turns * np.pi / 2
        self.heading = np.floor(1e4 * np.angle(np.exp(1j * heading))).astype(int)  # its middle is on no edge

    def motion(self) -> dict[str, list[Any]]:
        """Velocity and heading of every row, differences as in `_Tracks.numbers`."""
        velocity = turn_points(self.windows.world_velocity[self.kept], self.turns)
        vx, vy = np.rint(1000.0 * velocity).astype(int).T
        values = {"vx": vx, "vy": vy, "heading": self.heading}
        return {name: np.diff(series, prepend=0).tolist() for name, series in values.items()}

    def paths(self, shown: list[str]) -> dict[str, list[Any]]:
        """The true path and the point forecasts of some methods, as in `_bends`."""
        points = {name: self.windows.predictions[name].point for name in shown}
        return {
            name: self._bends(path[self.kept], self.rows.at, PATH_MM)
            for name, path in {"truth": self.windows.truth, **points}.items()
        }

    def modes(self, predictions: Predictions, settings: ReplaySettings) -> list[dict[str, list[Any]]]:
        """Weights of the modes of a method, and paths of the rows whose weight is not 0."""
        weight, paths = predictions.weight[self.kept, : settings.modes], predictions.path[self.kept]
        parts = np.where(weight < settings.least_weight, 0, np.rint(weight / WEIGHT)).astype(int)
        likely = parts > 0
        return [
            {
                "parts": parts[:, mode].tolist(),
                "bends": self._bends(paths[rows, mode], self.rows.at[rows], MODE_MM),
            }
            for mode, rows in enumerate(likely.T)
        ]

    def missed(self, ground: OccupancyMap) -> dict[str, list[Any]]:
        """Gaps between the network's inputs that differ from those computed from the rest; by how much."""
        off = self._inputs_off(ground, (self.heading + 0.5) * 1e-4).ravel()
        places = np.flatnonzero(off)
        return {"places": np.diff(places, prepend=0).tolist(), "by": off[places].tolist()}

    def _bends(self, paths: np.ndarray, at: np.ndarray, step_mm: int) -> list[Any]:
        """Second differences of the points of paths (m, [R, P, 2]) from `at` on, in steps. [2][P][R].

        A path that goes straight on at one speed has only its first point; the others are 0.
        """
        points = np.rint((self._place(paths) - at[:, None]) / step_mm).astype(int)
        return np.diff(points, 2, axis=1, prepend=np.zeros((len(points), 2, 2), int)).T.tolist()

    def _inputs_off(self, ground: OccupancyMap, heading_rad: np.ndarray) -> np.ndarray:
        """True inputs less those computed from what is kept. [W, cells^2 + cones] int.

        Others are those detected at the same time, where they are tracked if that is kept.
        """
        windows, rows, seen = self.windows, self.rows, self.seen
        crowd, (_, same, kept) = seen.at.copy(), np.intersect1d(seen.key, rows.key, return_indices=True)
        crowd[same] = rows.at[kept]
        order = np.argsort(seen.clock, kind="stable")
        span = [np.searchsorted(seen.clock[order], rows.clock, side) for side in ("left", "right")]
        at, cones, range_m = rows.at / 1000, windows.angular_grid_m.shape[1], windows.max_range_m
        crops = occupancy_crops(ground, at, heading_rad, windows.grid_cells, windows.grid_resolution_m)
        others = (crowd[order] / 1000, seen.track[order], rows.track, np.stack(span, axis=1))
        grid = angular_grids(at, heading_rad, *others, cones, range_m)

        def inputs(bits: np.ndarray, grid_m: np.ndarray) -> np.ndarray:
            levels = np.floor(grid_m.astype(float) * (LEVELS / range_m) + 0.5)
            return np.hstack([np.unpackbits(bits, axis=1, bitorder="little"), levels]).astype(np.int64)

        return inputs(windows.packed_grid[self.kept], windows.angular_grid_m[self.kept]) - inputs(crops, grid)

    def _tracks(self, track_id: np.ndarray, time_s: np.ndarray, position: np.ndarray) -> _Tracks:
        clock, at = np.rint(100.0 * (time_s - self.start_s)), np.rint(self._place(position))
        return _Tracks(track_id.astype(np.int64), clock.astype(np.int64), at.astype(np.int64))

    def _place(self, points: np.ndarray) -> np.ndarray:
        """World points (m, [..., 2]) in the plan, mm."""
        return 1000.0 * (turn_points(points, self.turns) - self.corner)
