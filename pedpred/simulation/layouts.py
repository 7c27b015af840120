"""Layouts: rooms drawn as shapes in metres, and their occupancy maps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pedpred.errors import ConfigError
from pedpred.scenes import OccupancyMap
from pedpred.simulation.shapes import inside

RESOLUTION_M = 0.1
WALL_CELLS = 3  # thickness of the outer walls
_LARGEST_SIDE_M = 200.0


@dataclass(frozen=True)
class Layout:
    """A walled room and what stands in it.

    Attributes:
        size_m: free width and depth between the outer walls; (0, 0) is the room's lower left corner. [2]
        shapes: obstacles, each `{kind: {field: value}}`, see `shapes.SHAPES`.
        target_regions: shapes that people walk between; empty = anywhere.
    """

    size_m: tuple[float, float]
    shapes: tuple[Mapping[str, Any], ...] = ()
    target_regions: tuple[Mapping[str, Any], ...] = ()

    def __post_init__(self) -> None:
        if len(self.size_m) != 2 or not all(0 < side <= _LARGEST_SIDE_M for side in self.size_m):
            raise ConfigError("size_m", self.size_m, f"two sides in (0, {_LARGEST_SIDE_M}] m are needed")

    def occupancy(self) -> OccupancyMap:
        """The map: outer walls all round, then every cell whose centre lies inside a shape.

        Raises:
            ConfigError: a shape is not understood, or no ground is left.
        """
        cells = np.round(np.array(self.size_m) / RESOLUTION_M).astype(int)
        occupied = np.pad(np.zeros(cells, dtype=bool), WALL_CELLS, constant_values=True)
        free = OccupancyMap(occupied, np.full(2, -WALL_CELLS * RESOLUTION_M), RESOLUTION_M)
        points = free.center_of(np.moveaxis(np.indices(occupied.shape), 0, -1))
        for index, shape in enumerate(self.shapes):
            occupied |= inside(points, shape, f"shapes[{index}]")
        if occupied.all():
            raise ConfigError("shapes", len(self.shapes), "they leave no free ground")
        return OccupancyMap(occupied, free.origin, RESOLUTION_M)


def layout_from(plain: Mapping[str, Any], key: str) -> Layout:
    """A layout from plain dictionaries, as in `conf/layouts`.

    Args:
        plain: `size_m`, optional `shapes` and `target_regions`.
        key: where it stands in the configuration, for the errors.

    Raises:
        ConfigError: a key is unknown or missing, or a shape is not understood.
    """
    unknown = set(plain) - {"size_m", "shapes", "target_regions"}
    if unknown:
        raise ConfigError(f"{key}.{min(unknown)}", plain[min(unknown)], "a layout has no such key")
    if "size_m" not in plain:
        raise ConfigError(f"{key}.size_m", None, "it is missing")
    try:
        layout = Layout(
            tuple(plain["size_m"]), tuple(plain.get("shapes", ())), tuple(plain.get("target_regions", ()))
        )
        layout.occupancy()
    except (ConfigError, TypeError) as cause:
        raise ConfigError(key, dict(plain), str(cause)) from cause
    return layout
