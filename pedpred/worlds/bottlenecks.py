"""Bottlenecks: a hall with a wall across it and one or two openings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.simulation.fields import Range
from pedpred.worlds.drawing import check_intervals, nested, uniform
from pedpred.worlds.floors import Area, Floor, ground_cells, paint_rectangle
from pedpred.worlds.streams import StreamSettings

_SIDE_M = 1.0  # thickness of the walls beside the hall
_PATTERNS = {"one_way": 0.55, "merging": 0.3, "two_way": 0.1, "all": 0.05}
_STREAMS = StreamSettings(patterns=_PATTERNS, dense_share=0.7, waiting_per_m2=(0.3, 2.2))


@dataclass(frozen=True)
class BottleneckSettings:
    """Ranges of bottlenecks.

    Attributes:
        width_m: of the hall.
        length_m: of the hall.
        wall_m: thickness of the wall; the length of the passage.
        opening_m: width of an opening, at most 0.8 of the hall.
        two_from_m: halls that are wider have two openings half of the time.
        centred_share: share of the openings in the middle of the wall.
        streams: who walks.
    """

    width_m: Range = (3.0, 12.0)
    length_m: Range = (16.0, 30.0)
    wall_m: Range = (0.2, 2.5)
    opening_m: Range = (0.9, 4.0)
    two_from_m: float = 7.0
    centred_share: float = 0.5
    streams: StreamSettings = nested(_STREAMS)

    def __post_init__(self) -> None:
        check_intervals(self, {"[2, 1000]": "width_m", "[14, 1000]": "length_m", "[0, 1000]": "two_from_m"})
        check_intervals(self, {"(0, 4]": "wall_m", "(0, 1000]": "opening_m"})


def bottleneck(settings: BottleneckSettings, rng: np.random.Generator) -> Floor:
    """Draw a hall along x; people come in at both ends."""
    width_m, length_m = uniform(rng, settings.width_m), uniform(rng, settings.length_m)
    low, high = _SIDE_M, _SIDE_M + width_m
    free = ground_cells((length_m, high + _SIDE_M), False)
    paint_rectangle(free, (0.0, low), (length_m, high), True)
    left = uniform(rng, (0.4 * length_m, 0.6 * length_m))
    right = left + uniform(rng, settings.wall_m)
    paint_rectangle(free, (left, 0.0), (right, high + _SIDE_M), False)
    narrow_m = 0.0
    for _ in range(int(rng.integers(1, 3)) if width_m > settings.two_from_m else 1):
        least, most = settings.opening_m
        opening_m = uniform(rng, (least, max(least, min(most, 0.8 * width_m))))
        centred = rng.random() < settings.centred_share
        bottom = low + (0.5 * (width_m - opening_m) if centred else rng.uniform(0.0, width_m - opening_m))
        paint_rectangle(free, (left, bottom), (right, bottom + opening_m), True)
        narrow_m += opening_m
    ends = [(0.0, 6.0), (length_m - 6.0, length_m)]
    entrances = tuple(Area(np.array([a, low]), np.array([b, high])) for a, b in ends)
    return Floor(free, entrances, width_m, narrow_m)
