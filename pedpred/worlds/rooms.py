"""Closed rooms with partitions, columns and furniture; people walk between places in them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pedpred.simulation.clutter import ClutterSettings, cluttered_room
from pedpred.simulation.fields import Range
from pedpred.worlds.drawing import check_intervals, nested, uniform
from pedpred.worlds.floors import Floor
from pedpred.worlds.visits import VisitSettings

_CLUTTER = ClutterSettings(
    side_m=(8.0, 38.0),
    partitions=(0, 3),
    smallest_room_m=4.0,
    door_m=(1.3, 3.2),
    second_door_share=0.6,
    wall_m=(0.2, 0.4),
    column_share=0.35,
    column_radius_m=(0.2, 0.5),
    column_spacing_m=(2.5, 5.5),
    furniture_share=(0.0, 0.14),
    turned_share=(0.0, 0.6),
    scale=(0.6, 1.6),
    clearance_m=0.6,
    attempts=150,
)


@dataclass(frozen=True)
class RoomSettings:
    """Ranges of rooms.

    Attributes:
        clutter: the generator of rooms; `side_m` holds the sides of all rooms.
        side_difference_m: largest difference between the sides of one room.
        visits: who walks.
    """

    clutter: ClutterSettings = nested(_CLUTTER)
    side_difference_m: float = 8.0
    visits: VisitSettings = nested(VisitSettings())

    def __post_init__(self) -> None:
        least, most = self.clutter.side_m
        check_intervals(self, {f"[0, {most - least}]": "side_difference_m"})


def room(settings: RoomSettings, rng: np.random.Generator) -> Floor:
    """Draw a room with its outer walls."""
    least, most = settings.clutter.side_m
    side_m = uniform(rng, (least, most - settings.side_difference_m))
    sides: Range = (side_m, side_m + settings.side_difference_m)
    return Floor(~cluttered_room(replace(settings.clutter, side_m=sides), rng).occupancy().occupied)
