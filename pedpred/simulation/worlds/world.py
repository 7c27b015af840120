"""The kinds of simulated worlds; from a kind and a seed to a scene: ground, people, and how they walk."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.simulation.crowd import Clock
from pedpred.simulation.ground import Ground, ground_of
from pedpred.simulation.routing import Routes, routes_to
from pedpred.simulation.settings import RoutingSettings
from pedpred.simulation.worlds.bottlenecks import set_up_bottleneck
from pedpred.simulation.worlds.corridors import set_up_corridor
from pedpred.simulation.worlds.drawing import draw_fields
from pedpred.simulation.worlds.floors import CELL_M, close_openings, show_on_map
from pedpred.simulation.worlds.journeys import State, WorldSetup
from pedpred.simulation.worlds.lone import simulate_lone_people
from pedpred.simulation.worlds.models import draw_model
from pedpred.simulation.worlds.people import draw_traits
from pedpred.simulation.worlds.rooms import set_up_room
from pedpred.simulation.worlds.settings import GuidanceSettings, WorldSettings
from pedpred.simulation.worlds.squares import set_up_square
from pedpred.simulation.worlds.walking import FixedWorld, walk

STEP_S = 0.05
RECORD_S = 0.1
_SET_UP: dict[str, Callable[[Any, float, np.random.Generator], WorldSetup]] = {
    "corridor": set_up_corridor,
    "bottleneck": set_up_bottleneck,
    "room": set_up_room,
    "square": set_up_square,
}
"""What draws ground and people of a kind, from the settings of the kind and the simulated time."""
_LONE = "lone"  # people far from each other, on ground without obstacles

DRAWN_KINDS = (*_SET_UP, _LONE)
"""Kinds that `simulate_world` draws from conf/worlds."""
KINDS = (*DRAWN_KINDS, "arrangement")
"""All kinds. An arrangement is a drawn layout or a random room of conf/simulations, such as the paper's
corridor and rooms; `simulation.kernel` moves its people. `worlds.walking` moves those of the other kinds."""


def simulate_world(kind: str, seed: int, settings: WorldSettings) -> Scene:
    """Simulate a world; the same kind, seed and settings give the same scene.

    People enter and leave, so tracks have different spans. Desired speeds, present goals and groups
    are recorded, too.

    Args:
        kind: one of `DRAWN_KINDS`.
        seed: number of the world.
        settings: ranges that it is drawn from.

    Returns:
        True positions and velocities every 0.1 s, named `<kind>_<seed>`.

    Raises:
        ValueRuleError: the kind is unknown.
    """
    if kind not in DRAWN_KINDS:
        raise ValueRuleError("kind", kind, f"it must be one of {', '.join(DRAWN_KINDS)}")
    rng, name = np.random.default_rng([settings.seed, zlib.crc32(kind.encode()), seed]), f"{kind}_{seed}"
    if kind == _LONE:
        return simulate_lone_people(settings.lone, RECORD_S, name, rng)
    occupancy, world = draw_visited_world(kind, settings, rng)
    duration_s = getattr(settings, kind).duration_s
    return Scene(name, record_walking(world, settings.warm_up_s, duration_s, rng), occupancy, RECORD_S)


def draw_visited_world(
    kind: str, settings: WorldSettings, rng: np.random.Generator
) -> tuple[OccupancyMap, FixedWorld]:
    """Draw ground, and people who will come, walk and leave.

    Args:
        kind: of world, one with people who come and leave.
        settings: ranges that all is drawn from.
        rng: source of all randomness.

    Returns:
        The map, and all that does not change while people walk.
    """
    ranges = getattr(settings, kind)
    floor, visitors, whole_map, closed_m = _SET_UP[kind](ranges, settings.warm_up_s + ranges.duration_s, rng)
    occupied = ~floor.free if whole_map else show_on_map(floor.free, rng)
    if closed_m > 0:
        occupied = close_openings(occupied, closed_m)
    journeys, dense = visitors.journeys, visitors.dense
    model = draw_model(settings.model, dense, visitors.spacing_m, visitors.reach_m, visitors.leave, rng)
    traits = draw_traits(journeys.group, settings.people, model.collision_free, dense, visitors.stops, rng)
    ground, routes = draw_routes(floor.free, visitors.target, settings.guidance, rng)
    world = FixedWorld(journeys, traits, model, ground, routes)
    return OccupancyMap(occupied, np.zeros(2), CELL_M), world


def draw_routes(
    free: np.ndarray, target: np.ndarray, settings: GuidanceSettings, rng: np.random.Generator
) -> tuple[Ground, Routes]:
    """Compute obstacles, and routes to the targets; on ground without obstacles they are straight."""
    ground = ground_of(OccupancyMap(~free, np.zeros(2), CELL_M))
    routing = RoutingSettings(settings.resolution_m, **draw_fields(settings, rng))
    if not free.all():
        return ground, routes_to(target, ground, routing)
    nowhere = np.zeros((len(target), 2, 2, 2), dtype=np.float32)  # the kernel then walks straight
    return ground, Routes(target, np.zeros(2), routing.resolution_m, nowhere)


def record_walking(
    world: FixedWorld, skipped_s: float, recorded_s: float, rng: np.random.Generator
) -> Trajectories:
    """Let people walk, and record them after a while.

    Args:
        world: ground, and everybody who comes.
        skipped_s: time before the record.
        recorded_s: its length.
        rng: source of all randomness.
    """
    every, skipped = round(RECORD_S / STEP_S), round(skipped_s / RECORD_S)
    steps = (skipped + round(recorded_s / RECORD_S)) * every
    clock, journeys = Clock(STEP_S, steps, every, every), world.journeys
    record, person, leg, state = walk(world, State.before(journeys), clock, rng)
    kept = record >= skipped
    record, person, leg, state = record[kept] - skipped, person[kept], leg[kept], state[kept]
    return Trajectories(
        time_s=np.round(record * RECORD_S, 9),
        track_id=person,
        position=state[:, :2],
        velocity=state[:, 2:],
        goal=world.routes.target[journeys.plan[person, leg]],
        desired_speed_mps=world.traits.desired_speed[person],
        group_id=journeys.group[person],
    )
