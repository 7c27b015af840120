"""Bottlenecks: a hall with a wall across it and one or two openings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pedpred.settings import In, Range, Settings
from pedpred.simulation.worlds.drawing import uniform, whole_number
from pedpred.simulation.worlds.floors import Area, Floor, ground_cells, paint_rectangle
from pedpred.simulation.worlds.journeys import WorldSetup
from pedpred.simulation.worlds.streams import StreamSettings, draw_streams

_SIDE_M = 1.0  # thickness of the walls beside the hall


@dataclass(frozen=True)
class BottleneckSettings(Settings):
    """Ranges of bottlenecks.

    Attributes:
        duration_s: recorded time.
        width_m: of the hall.
        length_m: of the hall.
        wall_m: thickness of the wall; the length of the passage.
        opening_m: width of an opening, at most 0.8 of the hall.
        two_from_m: halls that are wider have two openings half of the time.
        centred_share: share of the openings in the middle of the wall.
        streams: who walks.
    """

    duration_s: Annotated[float, In("(0, 36000]")]
    width_m: Annotated[Range, In("[2, 1000]")]
    length_m: Annotated[Range, In("[14, 1000]")]
    wall_m: Annotated[Range, In("(0, 4]")]
    opening_m: Annotated[Range, In("(0, 1000]")]
    two_from_m: Annotated[float, In("[0, 1000]")]
    centred_share: Annotated[float, In("[0, 1]")]
    streams: StreamSettings


def draw_bottleneck(settings: BottleneckSettings, rng: np.random.Generator) -> Floor:
    """Draw a hall along x; people come in at both ends."""
    width_m, length_m = uniform(rng, settings.width_m), uniform(rng, settings.length_m)
    low, high = _SIDE_M, _SIDE_M + width_m
    free = ground_cells((length_m, high + _SIDE_M), False)
    paint_rectangle(free, (0.0, low), (length_m, high), True)
    left = uniform(rng, (0.4 * length_m, 0.6 * length_m))
    right = left + uniform(rng, settings.wall_m)
    paint_rectangle(free, (left, 0.0), (right, high + _SIDE_M), False)
    narrow_m = 0.0
    for _ in range(whole_number(rng, (1, 2)) if width_m > settings.two_from_m else 1):
        least, most = settings.opening_m
        opening_m = uniform(rng, (least, max(least, min(most, 0.8 * width_m))))
        centred = rng.random() < settings.centred_share
        bottom = low + (0.5 * (width_m - opening_m) if centred else rng.uniform(0.0, width_m - opening_m))
        paint_rectangle(free, (left, bottom), (right, bottom + opening_m), True)
        narrow_m += opening_m
    ends = [(0.0, 6.0), (length_m - 6.0, length_m)]
    entrances = tuple(Area(np.array([a, low]), np.array([b, high])) for a, b in ends)
    return Floor(free, entrances, width_m, narrow_m)


def set_up_bottleneck(
    settings: BottleneckSettings, duration_s: float, rng: np.random.Generator
) -> WorldSetup:
    """Draw a hall with a bottleneck and its people during some time (with the warm-up)."""
    floor = draw_bottleneck(settings, rng)
    return WorldSetup(floor, draw_streams(floor, settings.streams, duration_s, rng), whole_map=False)
