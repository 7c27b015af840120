"""Which part of a world a sensor sees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import OccupancyMap
from pedpred.settings import In, Range, Settings, check_names, load
from pedpred.simulation.worlds.floors import Area
from pedpred.simulation.worlds.world import KINDS


@dataclass(frozen=True)
class ViewSettings(Settings):
    """Which rectangle of a world a sensor sees.

    Attributes:
        cut_x_m: unseen ground at both ends along x.
        cut_y_m: the same along y; negative: the view goes beyond the map.
        window_share: share of the worlds with a square window around a point near the centre instead.
        window_m: half of its side.
    """

    cut_x_m: Annotated[Range, In("(-inf, inf)")]
    cut_y_m: Annotated[Range, In("(-inf, inf)")]
    window_share: Annotated[float, In("[0, 1]")]
    window_m: Annotated[Range, In("(0, 1000]")]


def parse_views(plain: Mapping[str, Any], path: str) -> dict[str, ViewSettings]:
    """Parse the views of all kinds of worlds.

    Raises:
        ValueRuleError: a kind is unknown or missing, or a field breaks its rule.
    """
    rule = f"it must have the entries {', '.join(KINDS)}"
    check_names(KINDS, plain, path, rule)
    if missing := [kind for kind in KINDS if kind not in plain]:
        raise ValueRuleError(f"{path}.{missing[0]}", None, rule)
    return {kind: load(ViewSettings, view, f"{path}.{kind}") for kind, view in plain.items()}


def draw_view(occupancy: OccupancyMap, settings: ViewSettings, rng: np.random.Generator) -> Area:
    """Draw the rectangle that a sensor sees of a world."""
    low, high = occupancy.origin, occupancy.origin + occupancy.extent_m
    if rng.random() < settings.window_share:
        center = low + rng.uniform(0.3, 0.7, 2) * occupancy.extent_m
        half = rng.uniform(*settings.window_m)
        return Area(center - half, center + half)
    cut = np.array([rng.uniform(*settings.cut_x_m), rng.uniform(*settings.cut_y_m)])
    return Area(low + cut, high - cut)
