"""Simulated worlds with walls as places to drive in; their people respect the robot, or do not see it."""

from __future__ import annotations

import copy
import functools
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.driving.episodes import DriveSettings, Episode, Place, draw_episode
from pedpred.driving.walkers import Walkers, with_robot
from pedpred.errors import StorageError, ValueRuleError
from pedpred.fields import parsed
from pedpred.files import read_bytes, read_yaml
from pedpred.scenes import OccupancyMap, Scene
from pedpred.simulation.worlds.corridors import CorridorSettings, set_up_corridor
from pedpred.simulation.worlds.drawing import nested
from pedpred.simulation.worlds.floors import CELL_M, show_on_map
from pedpred.simulation.worlds.journeys import Stage
from pedpred.simulation.worlds.models import ModelSettings, draw_model
from pedpred.simulation.worlds.people import PeopleSettings, draw_traits
from pedpred.simulation.worlds.rooms import RoomSettings, set_up_room
from pedpred.simulation.worlds.settings import GuidanceSettings
from pedpred.simulation.worlds.squares import SquareSettings, set_up_square
from pedpred.simulation.worlds.walking import FixedWorld
from pedpred.simulation.worlds.world import RECORD_S, draw_routes, record_walking

SETTINGS = Path(__file__).with_name("worlds.yaml")
_WARM_UP_S = 20.0
_BEFORE_END_S = 35.0  # an episode begins so long before people stop coming
_DRAWS = 50  # worlds tried for an episode
_TRIES = 200  # ways tried in one

_SET_UP: dict[str, Callable[[Any, float, np.random.Generator], Stage]] = {
    "corridor": set_up_corridor,
    "room": set_up_room,
    "square": set_up_square,
}
KINDS = tuple(_SET_UP)
REACTIONS = ("react", "ignore")


@dataclass(frozen=True)
class WorldRanges:
    """What worlds are drawn from; the file beside this module holds them."""

    corridor: CorridorSettings = nested(CorridorSettings)
    room: RoomSettings = nested(RoomSettings)
    square: SquareSettings = nested(SquareSettings)
    people: PeopleSettings = nested(PeopleSettings)
    model: ModelSettings = nested(ModelSettings)
    guidance: GuidanceSettings = nested(GuidanceSettings)


@functools.cache
def _ranges() -> WorldRanges:
    ranges: WorldRanges = parsed(WorldRanges, read_yaml(SETTINGS, partial(StorageError, SETTINGS, "file")))
    return ranges


@dataclass(frozen=True)
class Worlds:
    """Every episode takes place in a world of its own, in which `walk` moves people as in training worlds.

    Attributes:
        kind: one of `KINDS`.
        react: whether people see the robot as one of them.
    """

    kind: str
    react: bool

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueRuleError("kind", self.kind, f"it must be one of {', '.join(KINDS)}")

    @property
    def name(self) -> str:
        """For tables."""
        return f"{self.kind}_{REACTIONS[0] if self.react else REACTIONS[1]}"

    def digest(self) -> bytes:
        """Bytes that identify it."""
        return self.name.encode() + read_bytes(SETTINGS)

    def draw(self, number: int, settings: DriveSettings) -> tuple[Place, Episode]:
        """Draw a world and an episode in it from (seed, number) alone.

        People are the same, until they meet the robot, whether they react or not.

        Raises:
            ValueRuleError: in no world that was tried a robot meets anybody.
        """
        for attempt in range(_DRAWS):
            key = [settings.seed, zlib.crc32(self.kind.encode()), number, attempt]
            scene, walkers = draw_world(self.kind, key, settings.robot.radius_m, settings.planner.dt_s)
            last_s = getattr(_ranges(), self.kind).duration_s - _BEFORE_END_S
            try:
                place = Place.of(scene, settings.planner.dt_s)
                episode = draw_episode(place, number, settings, _TRIES, last_s)
            except ValueRuleError:  # nobody walks there, or nobody can be met
                continue
            if self.react:
                at_s = _WARM_UP_S + RECORD_S + place.people.start_s + episode.tick * settings.planner.dt_s
                walkers.advance(round(at_s / settings.planner.dt_s))
                episode = episode.among(walkers, settings, key)
            return place, episode
        raise ValueRuleError("--world", self.kind, f"in {_DRAWS} worlds nobody can be met")


def draw_world(kind: str, key: list[int], radius_m: float, dt_s: float) -> tuple[Scene, Walkers]:
    """Draw a world: recorded without a robot, and its people before they come.

    Args:
        kind: one of `KINDS`.
        key: seeds of the random numbers.
        radius_m: of the robot that they will meet.
        dt_s: time between two instants of its clock, s.
    """
    rng, ranges = np.random.default_rng(key), _ranges()
    own = getattr(ranges, kind)
    floor, visitors, whole_map, _ = _SET_UP[kind](own, _WARM_UP_S + own.duration_s, rng)
    occupied = ~floor.free if whole_map else show_on_map(floor.free, rng)
    dense = visitors.dense
    model = draw_model(ranges.model, dense, visitors.spacing_m, visitors.reach_m, visitors.leave, rng)
    group = visitors.journeys.group
    traits = draw_traits(group, ranges.people, model.collision_free, dense, visitors.stops, rng)
    ground, routes = draw_routes(floor.free, visitors.target, ranges.guidance, rng)
    journeys, all_traits = with_robot(visitors.journeys, traits, radius_m)
    world = FixedWorld(journeys, all_traits, model, ground, routes)
    walkers = Walkers(world, copy.deepcopy(rng), dt_s)
    seconds = _WARM_UP_S, own.duration_s
    people = record_walking(visitors.journeys, traits, model, ground, routes, seconds, rng)
    name = f"{kind}_{'_'.join(map(str, key[2:]))}"
    return Scene(name, people, OccupancyMap(occupied, np.zeros(2), CELL_M), RECORD_S), walkers
