"""A stretch of a scene for the page's player: what was seen, what was forecast and what the network saw.

Lengths are whole millimetres from the lower left corner of the map, times hundredths of a second from the
beginning of the stretch, headings tenths of a milliradian. Everything is turned like the scene's camera
picture, as in the plans of the report. Columns are predicted from earlier ones (`codec.py`); points of true
and forecast paths are exact to half of `PATH_MM`, those of modes to half of `MODE_MM`, and about every second
one is kept. The network's inputs are computed from map and positions,
here as in the player (`replay.js`), and the differences to the true inputs are stored: the player shows every
bit of the obstacle grid, and the angular grid in steps of its range / `LEVELS`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pedpred.features import angular_grids, occupancy_crops
from pedpred.forecasting import Methods
from pedpred.report.animation import LONGEST_GAP, busiest_start
from pedpred.report.page.codec import Coder, PointColumns
from pedpred.report.plan import obstacle_image, quarter_turns_of, turned
from pedpred.scenes import OccupancyMap, Predictions, Scene
from pedpred.simulation.fields import check_ranges
from pedpred.storage.windows import EvaluationWindows

TAIL_S = 2.0
"""Time before the stretch for which detections are kept, s."""
PATH_MM, MODE_MM = 10, 50
"""Steps of the points of true paths and point forecasts, and of modes, which are drawn as lines, mm."""
WEIGHT = 0.05
"""Weights of modes are whole multiples of this."""
LEVELS = 240
"""Distances of the angular grid are whole multiples of its range / `LEVELS`, 2.5 cm of 6 m."""
_LINES_BEFORE = 3
"""Steps before the present at which the line between detections predicts the present."""
_UNITS: dict[str, Any] = {"path_mm": PATH_MM, "mode_mm": MODE_MM, "weight": WEIGHT, "levels": LEVELS}
_UNITS |= {"lines_before": _LINES_BEFORE, "tail_s": TAIL_S}


@dataclass(frozen=True)
class ReplaySettings:
    """What is kept of each scene.

    Attributes:
        methods: keys of those whose forecasts are kept beside the main method's, where they were evaluated.
        duration_s: of the stretch, which holds most forecasts.
        modes: the most likely ones of each forecast that are kept.
        least_weight: less likely modes are left out, too.
    """

    methods: tuple[str, ...]
    duration_s: float
    modes: int
    least_weight: float

    def __post_init__(self) -> None:
        check_ranges(self, {"duration_s": "(0, 36000]", "modes": "[1, 1000]", "least_weight": "[0, 1]"})


@dataclass(frozen=True)
class Replay:
    """The player's data."""

    header: dict[str, Any]  # names, sizes and units
    data: str  # everything else, in the order in which `replay` and `replay.js` go through it


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
    order, coarse = orders(steps)
    turns = quarter_turns_of(scene.camera)
    image, (left, right, bottom, top) = obstacle_image(scene.occupancy, turns)
    ground = OccupancyMap(image.T, np.zeros(2), scene.occupancy.resolution_m)
    stretch = _Stretch(scene, windows, start_s, duration_s, turns, np.array([left, bottom]))
    coder = Coder()
    coder.changes(np.diff(image.ravel().astype(np.int64), prepend=0))
    stretch.write_people(coder)
    table = stretch.write_presents(coder)
    stretch.write_paths(table, shown, order)
    for name in several:
        stretch.write_modes(coder, table, windows.predictions[name], coarse, settings)
    stretch.write_inputs(coder, ground)
    header = _UNITS | {
        "name": scene.name,
        "start_s": round(start_s, 2),
        "duration_s": duration_s,
        "step_s": windows.dt_s,
        "steps": steps,
        "order": order,
        "gap_s": round(LONGEST_GAP * scene.detection_dt_s, 3),
        "size_m": [round(right - left, 3), round(top - bottom, 3)],
        "map_cells": ground.occupied.shape,
        "map_cell_m": ground.resolution_m,
        "cell_m": windows.grid_resolution_m,
        "grid_cells": windows.grid_cells,
        "cones": windows.angular_grid_m.shape[1],
        "range_m": windows.max_range_m,
        "methods": shown,
        "modes": {name: min(windows.predictions[name].modes, settings.modes) for name in several},
        "mode_order": coarse,
        "drawn": methods.main.key,
        "seen": len(stretch.seen.track),
        "rows": len(stretch.rows.track),
    }
    return Replay(header, coder.text())


def orders(steps: int) -> tuple[list[int], list[int]]:
    """Points of a path in the order in which they are kept, the last one first; and those of modes."""
    strides = (steps, steps // 2 or 1, steps // 5 or 1)
    coarse = list(dict.fromkeys(k for stride in strides for k in range(stride, steps + 1, stride)))
    return list(dict.fromkeys([*coarse, *range(1, steps + 1)])), coarse


class _Tracks:
    """Rows of people, sorted by track and time."""

    def __init__(self, track: np.ndarray, clock: np.ndarray, at: np.ndarray):
        """Tracks and times in hundredths of a second, [N] int; positions, mm, [N, 2] int."""
        self.track, self.clock, self.at = track, clock, at
        self.key = track * 2**32 + clock

    def line(self, track: np.ndarray, clock: np.ndarray) -> np.ndarray:
        """Positions at times [W] between rows of tracks [W], held before and after; 0 of others. [W, 2]."""
        first, last = np.searchsorted(self.track, track), np.searchsorted(self.track, track, "right") - 1
        after = np.clip(np.searchsorted(self.key, track * 2**32 + clock), first, last)
        before = np.clip(after - 1, first, after)
        way, span = clock - self.clock[before], self.clock[after] - self.clock[before]
        way, span = np.clip(way, 0, span)[:, None], np.maximum(span, 1)[:, None]
        twice = 2 * (self.at[before] * (span - way) + self.at[after] * way)
        return np.where((first <= last)[:, None], (twice + span) // (2 * span), 0)


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
        own = (windows.track_id[self.kept], windows.time_s[self.kept], windows.position[self.kept])
        self.rows = self._tracks(*own)

    def write_people(self, coder: Coder) -> None:
        """Who was seen, when and where; who has a forecast, and when."""
        for found in (self.seen, self.rows):
            coder.numbers(np.diff(found.track, prepend=0))
            coder.numbers(np.diff(found.clock, 2, prepend=[0, 0]))
        first = np.diff(self.seen.track, prepend=-1) != 0
        PointColumns(coder, self.seen.track).add(
            self.seen.at - np.where(first[:, None], 0, np.roll(self.seen.at, 1, axis=0))
        )

    def write_presents(self, coder: Coder) -> PointColumns:
        """Position, velocity and heading of every row; the table that predicts its paths from these."""
        windows, at, step = self.windows, self.rows.at, round(100 * self.windows.dt_s)
        steps = range(-_LINES_BEFORE, windows.truth.shape[1] + 2)
        lines = {k: self.seen.line(self.rows.track, self.rows.clock + k * step) for k in steps}
        table = PointColumns(coder, self.rows.track)
        for k in range(-_LINES_BEFORE, 0):
            table.know(lines[k] - lines[0])
        table.add(at - lines[0])
        velocity = table.add(np.rint(1000.0 * turned(windows.world_velocity[self.kept], self.turns)))
        for k in steps:
            table.know(lines[k] - at)
        course = np.arctan2(velocity[:, 1], velocity[:, 0])
        off = np.angle(np.exp(1j * (windows.heading_rad[self.kept] + self.turns * np.pi / 2 - course)))
        self.heading = np.floor(1e4 * (course + off))  # its middle is never on a cell's or cone's edge
        coder.numbers((self.heading - np.floor(1e4 * course)).astype(np.int64))
        return table

    def write_paths(self, table: PointColumns, shown: list[str], order: list[int]) -> None:
        """The true path and the point forecasts of some methods."""
        answers = [self.windows.predictions[name] for name in shown]
        for path in (self.windows.truth, *(own.point for own in answers)):
            points = self._place(path[self.kept])
            for point in order:
                table.add(points[:, point - 1] - self.rows.at, PATH_MM)

    def write_modes(
        self, coder: Coder, table: PointColumns, own: Predictions, order: list[int], settings: ReplaySettings
    ) -> None:
        """Weights and some points of the modes of a method; those left out have the weight 0."""
        weight, paths = own.weight[self.kept, : settings.modes], self._place(own.path[self.kept])
        parts = np.where(weight < settings.least_weight, 0, np.rint(weight / WEIGHT)).astype(np.int64)
        for mode in range(parts.shape[1]):
            coder.numbers(parts[:, mode])
            for point in order:
                table.add(paths[:, mode, point - 1] - self.rows.at, MODE_MM, parts[:, mode] > 0)

    def write_inputs(self, coder: Coder, ground: OccupancyMap) -> None:
        """What the network's inputs differ by from those computed from the rest."""
        coder.changes(self._inputs_off(ground, (self.heading + 0.5) * 1e-4))

    def _inputs_off(self, ground: OccupancyMap, heading_rad: np.ndarray) -> np.ndarray:
        """True inputs less those computed from what is kept. [W, cells^2 + cones] int.

        Others are those detected at the same time, where they are tracked if that is kept.
        """
        windows, rows, seen = self.windows, self.rows, self.seen
        crowd, (_, same, own) = seen.at.copy(), np.intersect1d(seen.key, rows.key, return_indices=True)
        crowd[same] = rows.at[own]
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
        return 1000.0 * (turned(points, self.turns) - self.corner)
