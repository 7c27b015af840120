"""A stretch of a scene for the page's player: what was seen and what was forecast.

Lengths are whole centimetres from the lower left corner of the map, times hundredths of a second from the
beginning of the stretch. Everything is turned like the scene's camera picture, as in the plans of the report.
Columns hold differences that are mostly small: detections to the previous row, present and true positions to
the straight line between detections, forecasts to an interpolation of their own points (see `path_codes`).
`replay.js` reverses this, and computes the inputs of the network from the map and the detections.
"""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.forecasting import Methods
from pedpred.report.animation import LONGEST_GAP, busiest_start
from pedpred.report.plan import obstacle_image, quarter_turns_of, turned
from pedpred.scenes import Scene
from pedpred.storage.windows import EvaluationWindows

TAIL_S = 2.0
"""Time before the stretch for which detections are kept, s."""
COARSE_CM = 3
"""Step of the differences between a path and its interpolation, cm: points are exact to a third of it."""


@dataclass(frozen=True)
class Replay:
    """The player's data."""

    header: dict[str, Any]  # names, sizes and units; `columns` lists (name, shape) in the order of the data
    data: bytes  # raw deflate of all columns one after the other, see `packed`

    def text(self) -> str:
        """The data in base 64, which can stand in a page."""
        return base64.b64encode(self.data).decode()


def replay(scene: Scene, windows: EvaluationWindows, duration_s: float, methods: Methods) -> Replay:
    """Pack the stretch of a scene, at most `duration_s` long, that holds most forecasts.

    Raises:
        ValueRuleError: there are no forecasts, or a value has no place in 16 bits.
    """
    start_s = busiest_start(windows.time_s, duration_s)
    duration_s = round(min(duration_s, float(windows.time_s.max()) - start_s), 2)
    turns = quarter_turns_of(scene.camera)
    image, (left, right, bottom, top) = obstacle_image(scene.occupancy, turns)
    shown = methods.ordered(windows.predictions)
    stretch = _Stretch(start_s, duration_s, windows.dt_s, turns, np.array([left, bottom]))
    columns = {"obstacles": np.packbits(image, axis=1, bitorder="little").astype(np.int64)}
    columns |= stretch.columns(scene, windows, shown)
    header = {
        "name": scene.name,
        "start_s": round(start_s, 2),
        "duration_s": duration_s,
        "step_s": windows.dt_s,
        "steps": windows.truth.shape[1],
        "gap_s": round(LONGEST_GAP * scene.detection_dt_s, 3),
        "tail_s": TAIL_S,
        "size_m": [round(right - left, 3), round(top - bottom, 3)],
        "map_columns": image.shape[1],
        "cell_m": windows.grid_resolution_m,
        "grid_cells": windows.grid_cells,
        "cones": windows.angular_grid_m.shape[1],
        "range_m": windows.max_range_m,
        "coarse_cm": COARSE_CM,
        "methods": shown,
        "drawn": methods.main.key,
        "columns": [[name, list(values.shape)] for name, values in columns.items()],
    }
    return Replay(header, packed(list(columns.values())))


@dataclass(frozen=True)
class _Stretch:
    """Which part of a scene is kept, and how it is turned and moved."""

    start_s: float
    duration_s: float
    step_s: float
    turns: int
    corner: np.ndarray

    def columns(self, scene: Scene, windows: EvaluationWindows, shown: list[str]) -> dict[str, np.ndarray]:
        """Detections by track and time, forecasts by time and track."""
        steps, seen = windows.truth.shape[1], scene.trajectories
        end_s = self.start_s + self.duration_s
        last_s = end_s + steps * self.step_s
        seen = seen.select((seen.time_s >= self.start_s - TAIL_S) & (seen.time_s <= last_s))
        order = np.lexsort((seen.time_s, seen.track_id))
        track, clock = _whole("track_id", seen.track_id[order]), self._clock(seen.time_s[order])
        where = self._place("position", seen.position[order])
        inside = (windows.time_s >= self.start_s) & (windows.time_s <= end_s)
        order = np.lexsort((windows.track_id, np.round(windows.time_s, 3)))
        rows = order[inside[order]]
        own, time = _whole("track_id", windows.track_id[rows]), self._clock(windows.time_s[rows])
        ahead = np.arange(steps + 1) * round(100 * self.step_s)
        line = _between(track, clock, where, own, time[:, None] + ahead)
        true = np.concatenate([windows.position[rows, None], windows.truth[rows]], axis=1)
        true = self._place("truth", true)
        heading_rad = np.angle(np.exp(1j * (windows.heading_rad[rows] + self.turns * np.pi / 2)))
        columns = {
            "seen_track": np.diff(track, prepend=0),
            "seen_time": np.diff(clock, prepend=0),
            "seen_at": np.diff(where, axis=0, prepend=0).T,
            "track": np.diff(own, prepend=0),
            "time": np.diff(time, prepend=0),
            "heading": _whole("heading_rad", 100.0 * heading_rad),
            "speed": _whole("velocity", 100.0 * np.linalg.norm(windows.velocity[rows], axis=-1)),
            "truth": (true - line).transpose(1, 2, 0),
        }
        for name in shown:
            path = self._place(name, windows.predictions[name].point[rows]) - true[:, :1]
            columns[f"path_{name}"] = path_codes(path, own).transpose(1, 2, 0)
        return columns

    def _clock(self, time_s: np.ndarray) -> np.ndarray:
        return _whole("time_s", 100.0 * (time_s - self.start_s))

    def _place(self, field: str, points: np.ndarray) -> np.ndarray:
        return _whole(field, 100.0 * (turned(points, self.turns) - self.corner))


def path_codes(path: np.ndarray, track: np.ndarray) -> np.ndarray:
    """Differences of paths to what is known of them, in the order of `point_order`: [W, P, 2] int.

    Paths ([W, P, 2], cm) are relative to the present position; rows are sorted by time and belong to `track`.
    The last point is coded as the difference to the last point of the track's previous row, the middle one
    exactly and all others in steps of `COARSE_CM`, both relative to the polynomial through the three nearest
    points that are known by then.
    """
    order = point_order(path.shape[1])
    known = {0: np.zeros_like(path[:, 0])}
    codes = []
    for rank, point in enumerate(order):
        if rank == 0:
            before = _previous(track)
            expected = np.where(before[:, None] >= 0, path[before, -1], 0)
        else:
            near = sorted(known, key=lambda other: (abs(other - point), other))[:3]
            weights = _lagrange(near, point)
            weighed = [weight * known[other] for weight, other in zip(weights, near, strict=True)]
            expected = np.floor(sum(weighed) + 0.5).astype(np.int64)
        step = COARSE_CM if rank > 1 else 1
        codes.append(np.floor((path[:, point - 1] - expected) / step + 0.5).astype(np.int64))
        known[point] = expected + step * codes[-1]
    return np.stack(codes, axis=1)


def point_order(steps: int) -> list[int]:
    """The points 1 to `steps`: the last one, then again and again the middle of the first largest gap."""
    order = [steps]
    while len(order) < steps:
        ends = sorted([0, *order])
        first, last = max(pairwise(ends), key=lambda gap: (gap[1] - gap[0], -gap[0]))
        order.append((first + last) // 2)
    return order


def packed(columns: list[np.ndarray]) -> bytes:
    """Deflate integers: zigzag (0, -1, 1, ... -> 0, 1, 2, ...), seven bits per byte, low ones first."""
    values = np.concatenate([column.ravel() for column in columns]).astype(np.int64)
    plain = np.where(values < 0, -2 * values - 1, 2 * values)
    parts = (plain[:, None] >> np.array([0, 7, 14])) & 127
    follows = plain[:, None] >= np.array([1 << 7, 1 << 14, 1 << 21])
    kept = np.column_stack([np.ones(len(plain), bool), follows[:, :2]])
    pack = zlib.compressobj(9, zlib.DEFLATED, -15, 9)
    return pack.compress((parts | (follows << 7)).astype(np.uint8)[kept].tobytes()) + pack.flush()


def _previous(track: np.ndarray) -> np.ndarray:
    """The row before each one that belongs to the same track; -1 for the first. [W]."""
    order = np.argsort(track, kind="stable")
    before = np.full(len(track), -1)
    same = track[order][1:] == track[order][:-1]
    before[order[1:][same]] = order[:-1][same]
    return before


def _lagrange(nodes: list[int], at: int) -> list[float]:
    """Weights of the values at the nodes in the value of the polynomial through them at another point."""
    factors = [[(at - other) / (node - other) for other in nodes if other != node] for node in nodes]
    return [float(np.prod(own)) for own in factors]


def _between(
    track: np.ndarray, clock: np.ndarray, where: np.ndarray, own: np.ndarray, asked: np.ndarray
) -> np.ndarray:
    """Positions of tracks [W] on the lines between their detections, cm, at times [W, T]. [W, T, 2] int."""
    line = np.zeros((*asked.shape, 2), np.int64)
    for one in np.unique(own):
        mine, rows = track == one, own == one
        for axis in range(2 if mine.any() else 0):
            found = np.interp(asked[rows], clock[mine], where[mine, axis])
            line[rows, :, axis] = np.floor(found + 0.5)
    return line


def _whole(field: str, values: np.ndarray) -> np.ndarray:
    """Rounded to integers; refuses what has no place in 16 bits."""
    rounded = np.round(values)
    largest = np.abs(rounded).max(initial=0)
    if not largest < 2**15:
        raise ValueRuleError(field, float(largest), "the player keeps whole numbers below 32768")
    return rounded.astype(np.int64)
