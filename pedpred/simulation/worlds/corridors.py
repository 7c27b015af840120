"""Corridors: straight, with a corner, a T, a crossing or two bends."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy import ndimage

from pedpred.settings import In, Range, Settings
from pedpred.simulation.worlds.drawing import (
    check_shares,
    draw_name,
    log_uniform,
    uniform,
    whole_number,
)
from pedpred.simulation.worlds.floors import CELL_M, Area, Floor, ground_cells, paint_disc, paint_rectangle
from pedpred.simulation.worlds.journeys import WorldSetup
from pedpred.simulation.worlds.streams import StreamSettings, draw_streams

_ENTRANCE_M = 3.5  # length of the part of an arm where people come in
_BEYOND_M = 4.0  # an arm goes on behind the length that is drawn
_ARMS = {"corner": "EN", "tee": "EWN", "cross": "EWNS", "bends": "EN", "straight": "EW"}
_AXES = {"E": (1.0, 0.0), "W": (-1.0, 0.0), "N": (0.0, 1.0), "S": (0.0, -1.0)}


@dataclass(frozen=True)
class CorridorSettings(Settings):
    """Ranges of corridors.

    Attributes:
        duration_s: recorded time.
        forms: share of each form.
        width_m: of most arms.
        any_width_m: of the other arms; log-uniform.
        any_width_share: share of those.
        equal_width_share: share of the worlds whose arms have equal widths.
        arm_m: length of the arms.
        column_share: share of the junctions with a column.
        column_radius_m: its radius.
        obstacle_share: share of the other corridors with obstacles.
        obstacles: their number.
        obstacle_radius_m: their radius.
        streams: who walks.
    """

    duration_s: Annotated[float, In("(0, 36000]")]
    forms: Mapping[str, Annotated[float, In("[0, 1]")]]
    width_m: Annotated[Range, In("(0, 1000]")]
    any_width_m: Annotated[Range, In("(0, 1000]")]
    any_width_share: Annotated[float, In("[0, 1]")]
    equal_width_share: Annotated[float, In("[0, 1]")]
    arm_m: Annotated[Range, In("[6, 1000]")]
    column_share: Annotated[float, In("[0, 1]")]
    column_radius_m: Annotated[Range, In("(0, 1000]")]
    obstacle_share: Annotated[float, In("[0, 1]")]
    obstacles: Annotated[tuple[int, int], In("[0, 1000]")]
    obstacle_radius_m: Annotated[Range, In("(0, 1000]")]
    streams: StreamSettings

    def __post_init__(self) -> None:
        super().__post_init__()
        check_shares(self, "forms", _ARMS)


def draw_corridor(settings: CorridorSettings, rng: np.random.Generator) -> Floor:
    """Draw a corridor: arms along the axes that meet at the centre of a square."""
    form = draw_name(rng, settings.forms)
    arm_m = uniform(rng, settings.arm_m)
    center = np.full(2, arm_m + _BEYOND_M)
    widths = [_width(settings, rng), _width(settings, rng)]  # of arms along x and along y
    if rng.random() < settings.equal_width_share:
        widths[1] = widths[0]
    free = ground_cells(2 * center, False)
    half = 0.5 * np.array(widths[::-1])  # extent of the junction along x is the width of arms along y
    paint_rectangle(free, center - half, center + half, True)
    ends = {}
    for arm in _ARMS[form]:
        area, ends[arm] = _arm(np.array(_AXES[arm]), center, half)
        paint_rectangle(free, area.low, area.high, True)
    if form == "bends":
        ends["N"] = _bend(free, center, half, arm_m, _width(settings, rng), rng)
    if form in ("tee", "cross") and rng.random() < settings.column_share:
        radius_m = uniform(rng, settings.column_radius_m)
        if min(widths) > 2 * radius_m + 1.6:
            paint_disc(free, center + rng.uniform(-0.5, 0.5, 2), radius_m)
    elif rng.random() < settings.obstacle_share:
        free = _with_obstacles(free, center, arm_m, settings, rng)
    width_m = sum(widths) / 2
    return Floor(free, tuple(ends.values()), width_m, width_m, form == "cross")


def set_up_corridor(settings: CorridorSettings, duration_s: float, rng: np.random.Generator) -> WorldSetup:
    """Draw a corridor and its people during some time (with the warm-up)."""
    floor = draw_corridor(settings, rng)
    return WorldSetup(floor, draw_streams(floor, settings.streams, duration_s, rng), whole_map=False)


def _width(settings: CorridorSettings, rng: np.random.Generator) -> float:
    unusual = rng.random() < settings.any_width_share
    return log_uniform(rng, settings.any_width_m) if unusual else uniform(rng, settings.width_m)


def _arm(axis: np.ndarray, center: np.ndarray, half: np.ndarray) -> tuple[Area, Area]:
    """The rectangle of an arm that points along an axis, and the entrance at its end."""
    across = half * (axis == 0)
    end, inner = center + axis * center[0], center + axis * (center[0] - _ENTRANCE_M)
    spans = []
    for start in (center, inner):
        spans.append(Area(np.minimum(start, end) - across, np.maximum(start, end) + across))
    return spans[0], spans[1]


def _bend(
    free: np.ndarray,
    center: np.ndarray,
    half: np.ndarray,
    arm_m: float,
    width_m: float,
    rng: np.random.Generator,
) -> Area:
    """Turn the northern arm east or west on its way; return the entrance at the new end."""
    bottom = center[1] + uniform(rng, (3.0, arm_m - 2.0))
    free[:, int((bottom + width_m) / CELL_M) :] = False
    size = 2 * center[0]
    if rng.random() < 0.5:
        paint_rectangle(free, (center[0] - half[0], bottom), (size, bottom + width_m), True)
        return Area(np.array([size - _ENTRANCE_M, bottom]), np.array([size, bottom + width_m]))
    paint_rectangle(free, (0.0, bottom), (center[0] + half[0], bottom + width_m), True)
    return Area(np.array([0.0, bottom]), np.array([_ENTRANCE_M, bottom + width_m]))


def _with_obstacles(
    free: np.ndarray, center: np.ndarray, arm_m: float, settings: CorridorSettings, rng: np.random.Generator
) -> np.ndarray:
    """Place small discs in the arms where they leave a way past. [X, Y] bool."""
    for _ in range(whole_number(rng, settings.obstacles)):
        along = np.array([1.0, 0.0] if rng.random() < 0.5 else [0.0, 1.0])
        place = center + rng.uniform(-arm_m, arm_m) * along + rng.uniform(-1.0, 1.0, 2)
        tried = free.copy()
        paint_disc(tried, place, uniform(rng, settings.obstacle_radius_m))
        if ndimage.label(ndimage.distance_transform_edt(tried) > 0.5 / CELL_M)[1] == 1:
            free = tried
    return free
