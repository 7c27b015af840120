"""People who walk between places in a closed room, and some who stand there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pedpred.settings import In, Range, Settings
from pedpred.simulation.layouts import TargetPool
from pedpred.simulation.simulator import draw_visiting_plans
from pedpred.simulation.worlds.drawing import log_uniform, uniform
from pedpred.simulation.worlds.floors import CELL_M, Area, Floor, draw_points
from pedpred.simulation.worlds.journeys import Journeys, Visitors, draw_number

_REACH_M = 0.45
_SPACING_M = 0.3
_AT_WALLS_M = 0.3  # clearance of the places: people walk up to shelves and walls


@dataclass(frozen=True)
class VisitSettings(Settings):
    """Ranges of people in rooms.

    Attributes:
        per_m2: people per square metre; log-uniform.
        dense_per_m2: the same in dense rooms.
        dense_share: share of those.
        people: least and largest number.
        targets: number of places.
        legs: places that a person visits one after the other; people stay at the last one.
        least_leg_m: least distance between two of them.
        pausing_share: share of the rooms where people pause at targets.
        pausing_people: share of the visits that end with a pause.
        pause_s: mean of the pauses of a room; log-uniform.
        standing_share: share of the rooms where some people stand all the time.
        standing_people: share of those people.
    """

    per_m2: Annotated[Range, In("(0, 1000]")]
    dense_per_m2: Annotated[Range, In("(0, 1000]")]
    dense_share: Annotated[float, In("[0, 1]")]
    people: Annotated[tuple[int, int], In("[1, 1000]")]
    targets: Annotated[int, In("[2, 1000]")]
    legs: Annotated[int, In("[1, 1000]")]
    least_leg_m: Annotated[float, In("(0, 1000]")]
    pausing_share: Annotated[float, In("[0, 1]")]
    pausing_people: Annotated[Range, In("[0, 1]")]
    pause_s: Annotated[Range, In("(0, 1000]")]
    standing_share: Annotated[float, In("[0, 1]")]
    standing_people: Annotated[Range, In("[0, 1]")]


def draw_visits(
    floor: Floor, settings: VisitSettings, duration_s: float, rng: np.random.Generator
) -> Visitors:
    """Draw the people of a room; all are there from the start and stay."""
    dense = bool(rng.random() < settings.dense_share)
    per_m2 = settings.dense_per_m2 if dense else settings.per_m2
    count = draw_number(float(floor.free.sum()) * CELL_M**2, per_m2, settings.people, rng)
    everywhere = Area(np.zeros(2), floor.size_m)
    target = draw_points(floor.free, everywhere, settings.targets, _AT_WALLS_M, rng)
    pool = TargetPool(target, np.arange(len(target)))
    plan = draw_visiting_plans(pool, count, settings.legs, settings.least_leg_m, rng)
    pauses = uniform(rng, settings.pausing_people) if rng.random() < settings.pausing_share else 0.0
    pause_s = rng.exponential(log_uniform(rng, settings.pause_s), plan.shape) * (
        rng.random(plan.shape) < pauses
    )
    stand = uniform(rng, settings.standing_people) if rng.random() < settings.standing_share else 0.0
    standing_s = np.where(rng.random(count) < stand, 2.0 * duration_s, 0.0)
    entry = draw_points(floor.free, everywhere, count, 0.4, rng)
    alone = np.full(count, -1, dtype=np.int64)
    journeys = Journeys(np.zeros(count), entry, plan, pause_s, standing_s, alone)
    return Visitors(journeys, target, dense, True, _SPACING_M, _REACH_M, False)
