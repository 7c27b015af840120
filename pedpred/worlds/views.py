"""Which part of a world a sensor sees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import OccupancyMap
from pedpred.simulation.fields import Range, check_names, parsed
from pedpred.worlds.drawing import check_intervals
from pedpred.worlds.floors import Area
from pedpred.worlds.settings import KINDS

VIEWED = (*KINDS, "scene")
"""Kinds of worlds, and simulated scenes of another origin."""


@dataclass(frozen=True)
class ViewSettings:
    """Which rectangle of a world a sensor sees.

    Attributes:
        cut_x_m: unseen ground at both ends along x.
        cut_y_m: the same along y; negative: the view goes beyond the map.
        window_share: share of the worlds with a square window around a point near the centre instead.
        window_m: half of its side.
    """

    cut_x_m: Range = (0.0, 4.5)
    cut_y_m: Range = (0.0, 4.5)
    window_share: float = 0.0
    window_m: Range = (5.0, 12.0)

    def __post_init__(self) -> None:
        check_intervals(self, {"(-inf, inf)": "cut_x_m cut_y_m", "(0, 1000]": "window_m"})


def usual_views() -> dict[str, ViewSettings]:
    """Usual views: some ground at the ends of corridors, halls and squares is not seen."""
    beyond: Range = (-1.0, -1.0)
    everything: Range = (-1e6, -1e6)
    return {
        "corridor": ViewSettings(),
        "bottleneck": ViewSettings(cut_y_m=(0.0, 0.0)),
        "room": ViewSettings(beyond, beyond, window_share=0.3),
        "square": ViewSettings((0.0, 2.0), (0.0, 2.0)),
        "lone": ViewSettings(everything, everything),
        "scene": ViewSettings(beyond, beyond),
    }


def parsed_views(plain: Mapping[str, Any], path: str) -> dict[str, ViewSettings]:
    """Parse the views of all kinds of worlds.

    Raises:
        ValueRuleError: a kind is unknown or missing, or a field breaks its rule.
    """
    rule = f"it must have the entries {', '.join(VIEWED)}"
    check_names(VIEWED, plain, path, rule)
    if missing := [kind for kind in VIEWED if kind not in plain]:
        raise ValueRuleError(f"{path}.{missing[0]}", None, rule)
    return {kind: parsed(ViewSettings, view, f"{path}.{kind}") for kind, view in plain.items()}


def drawn_view(occupancy: OccupancyMap, settings: ViewSettings, rng: np.random.Generator) -> Area:
    """Draw the rectangle that a sensor sees of a world."""
    low, high = occupancy.origin, occupancy.origin + occupancy.extent_m
    if rng.random() < settings.window_share:
        center = low + rng.uniform(0.3, 0.7, 2) * occupancy.extent_m
        half = rng.uniform(*settings.window_m)
        return Area(center - half, center + half)
    cut = np.array([rng.uniform(*settings.cut_x_m), rng.uniform(*settings.cut_y_m)])
    return Area(low + cut, high - cut)
