"""Closed rooms with partitions, columns and furniture; people walk between places in them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from pedpred.settings import In, Range, Settings
from pedpred.simulation.clutter import ClutterSettings, draw_cluttered_room
from pedpred.simulation.worlds.drawing import uniform
from pedpred.simulation.worlds.floors import Floor
from pedpred.simulation.worlds.journeys import WorldSetup
from pedpred.simulation.worlds.visits import VisitSettings, draw_visits


@dataclass(frozen=True)
class RoomSettings(Settings):
    """Ranges of rooms.

    Attributes:
        duration_s: recorded time.
        side_difference_m: largest difference between the sides of one room.
        clutter: the generator of rooms; `side_m` holds the sides of all rooms.
        visits: who walks.
        closed_share: share of the rooms whose map shows narrow openings closed; people pass all the same.
        closed_m: openings narrower than this are.
    """

    duration_s: Annotated[float, In("(0, 36000]")]
    side_difference_m: float
    closed_share: Annotated[float, In("[0, 1]")]
    closed_m: Annotated[Range, In("(0, 10]")]
    clutter: ClutterSettings
    visits: VisitSettings

    def __post_init__(self) -> None:
        super().__post_init__()
        least, most = self.clutter.side_m
        In(f"[0, {most - least}]").check("side_difference_m", self.side_difference_m, "a number")


def draw_room(settings: RoomSettings, rng: np.random.Generator) -> Floor:
    """Draw a room with its outer walls."""
    least, most = settings.clutter.side_m
    side_m = uniform(rng, (least, most - settings.side_difference_m))
    sides: Range = (side_m, side_m + settings.side_difference_m)
    return Floor(~draw_cluttered_room(replace(settings.clutter, side_m=sides), rng).occupancy().occupied)


def set_up_room(settings: RoomSettings, duration_s: float, rng: np.random.Generator) -> WorldSetup:
    """Draw a room and its people during some time (with the warm-up)."""
    floor = draw_room(settings, rng)
    visitors = draw_visits(floor, settings.visits, duration_s, rng)
    closed_m = uniform(rng, settings.closed_m) if rng.random() < settings.closed_share else 0.0
    return WorldSetup(floor, visitors, whole_map=True, closed_m=closed_m)
