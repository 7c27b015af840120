"""A stretch of a scene for the page's player: what was seen, what was forecast, what the network saw.

Lengths are whole centimetres from the lower left corner of the map, times hundredths of a second from the
beginning of the stretch; a path is kept as the steps between its points, which pack better than the points.
Everything is turned like the scene's camera picture, as in the plans of the report.
"""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.report.animation import busiest_start
from pedpred.report.methods import ordered
from pedpred.report.plan import obstacle_image, quarter_turns_of, turned
from pedpred.scenes import Scene
from pedpred.storage.windows import CELL_M, RANGE_M, Windows

TAIL_S = 2.0
"""How much of the way behind people is kept before the stretch begins, s."""
ANGULAR_LEVELS = 240
"""An angular cell is kept as a whole number of `RANGE_M` / `ANGULAR_LEVELS`, 2.5 cm."""
_LONGEST_GAP = 1.5
"""A person counts as gone within gaps longer than this many detection intervals."""


@dataclass(frozen=True)
class Replay:
    """What the player gets.

    Attributes:
        header: names, sizes and units; `columns` lists (name, type, shape) in the order of the data.
        data: the columns one after the other, little endian, as deflated bytes.
    """

    header: dict[str, Any]
    data: bytes

    def text(self) -> str:
        """The data in base 64, which can stand in a page."""
        return base64.b64encode(self.data).decode()


def replay(scene: Scene, windows: Windows, duration_s: float, step_s: float = 0.3) -> Replay:
    """The stretch of a scene that holds most forecasts.

    Args:
        scene: people and obstacles.
        windows: forecasts in this scene.
        duration_s: how long the stretch is at most.
        step_s: between two points of a forecast.

    Raises:
        ValueRuleError: there are no forecasts, or a value has no place in 16 bits.
    """
    start_s = busiest_start(windows.time_s, duration_s)
    duration_s = round(min(duration_s, float(windows.time_s.max()) - start_s), 2)
    turns = quarter_turns_of(scene.camera)
    image, (left, right, bottom, top) = obstacle_image(scene.occupancy, turns)
    corner = np.array([left, bottom])
    columns = {"obstacles": np.packbits(image, axis=1, bitorder="little")}
    columns |= _detections(scene, start_s, duration_s, turns, corner)
    columns |= _forecasts(windows, start_s, duration_s, turns, corner)
    header = {
        "name": scene.name,
        "start_s": round(start_s, 2),
        "duration_s": duration_s,
        "step_s": step_s,
        "gap_s": round(_LONGEST_GAP * scene.detection_dt_s, 3),
        "tail_s": TAIL_S,
        "size_m": [round(right - left, 3), round(top - bottom, 3)],
        "map_columns": image.shape[1],
        "cell_m": CELL_M,
        "range_m": RANGE_M,
        "angular_levels": ANGULAR_LEVELS,
        "methods": ordered(windows.paths),
        "columns": [[name, values.dtype.name, list(values.shape)] for name, values in columns.items()],
    }
    return Replay(header, zlib.compress(b"".join(v.tobytes() for v in columns.values()), level=9))


def _detections(
    scene: Scene, start_s: float, duration_s: float, turns: int, corner: np.ndarray
) -> dict[str, np.ndarray]:
    """Who was seen where, by track and time, with the ways that lead into the stretch."""
    seen = scene.trajectories
    seen = seen.select((seen.time_s >= start_s - TAIL_S) & (seen.time_s <= start_s + duration_s))
    order = np.lexsort((seen.time_s, seen.track_id))
    return {
        "seen_track": _whole("track_id", seen.track_id[order]),
        "seen_time": _whole("time_s", 100.0 * (seen.time_s[order] - start_s)),
        "seen_at": _whole("position", 100.0 * (turned(seen.position[order], turns) - corner)),
    }


def _forecasts(
    windows: Windows, start_s: float, duration_s: float, turns: int, corner: np.ndarray
) -> dict[str, np.ndarray]:
    """What was forecast and what the network saw, by time and track."""
    inside = (windows.time_s >= start_s) & (windows.time_s <= start_s + duration_s)
    order = np.lexsort((windows.track_id, np.round(windows.time_s, 3)))
    rows = order[inside[order]]
    at = _whole("position", 100.0 * (turned(windows.position[rows], turns) - corner))
    heading_rad = np.angle(np.exp(1j * (windows.heading_rad[rows] + turns * np.pi / 2)))
    paths = {"truth": windows.truth}
    paths |= {f"path_{name}": windows.paths[name] for name in ordered(windows.paths)}
    columns = {
        "track": _whole("track_id", windows.track_id[rows]),
        "time": _whole("time_s", 100.0 * (windows.time_s[rows] - start_s)),
        "at": at,
        "heading": _whole("heading_rad", 1000.0 * heading_rad),
        "speed": _whole("velocity", 100.0 * np.linalg.norm(windows.velocity[rows], axis=-1)),
    }
    for name, path in paths.items():
        points = _whole(name, 100.0 * (turned(path[rows], turns) - corner))
        columns[name] = np.diff(points, axis=1, prepend=at[:, None])
    columns["grid"] = windows.packed_grid[rows]
    levels = np.round(windows.angular_grid_m[rows] * (ANGULAR_LEVELS / RANGE_M))
    columns["angular"] = levels.astype(np.uint8)
    return columns


def _whole(field: str, values: np.ndarray) -> np.ndarray:
    """Rounded to 16-bit integers, little endian; refuses what does not fit."""
    rounded = np.round(values)
    largest = np.abs(rounded).max(initial=0)
    if not largest < 2**15:
        raise ValueRuleError(field, float(largest), "the player keeps whole numbers below 32768")
    return rounded.astype("<i2")
