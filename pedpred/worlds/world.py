"""From a kind and a seed to a world: ground, people, walking, and the scene that comes of it."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.simulation.crowd import Clock
from pedpred.simulation.ground import Ground, ground_of
from pedpred.simulation.routing import Routes, routes_to
from pedpred.simulation.settings import RoutingSettings
from pedpred.worlds.bottlenecks import bottleneck
from pedpred.worlds.corridors import corridor
from pedpred.worlds.drawing import uniform
from pedpred.worlds.floors import CELL_M, Floor, shown
from pedpred.worlds.journeys import Journeys, State, Visitors
from pedpred.worlds.models import WalkingModel, drawn_model
from pedpred.worlds.people import Traits, drawn_traits
from pedpred.worlds.rooms import room
from pedpred.worlds.settings import KINDS, GuidanceSettings, WorldSettings
from pedpred.worlds.squares import square
from pedpred.worlds.streams import streaming
from pedpred.worlds.strolls import strolling
from pedpred.worlds.visits import visiting
from pedpred.worlds.walking import walk

STEP_S = 0.05
RECORD_S = 0.1
_FAR_M = 500.0  # between lone people


class Stage(NamedTuple):
    """A world before anybody walks.

    Attributes:
        floor: the ground.
        visitors: the people; their start counts from the beginning of the warm-up.
        duration_s: recorded time.
    """

    floor: Floor
    visitors: Visitors
    duration_s: float


def simulate_world(kind: str, seed: int, settings: WorldSettings) -> Scene:
    """Simulate a world; the same kind, seed and settings give the same scene.

    People enter and leave, so tracks have different spans. Desired speeds, present goals and groups
    are recorded, too.

    Args:
        kind: one of `KINDS`.
        seed: number of the world.
        settings: ranges that it is drawn from.

    Returns:
        True positions and velocities every 0.1 s, named `<kind>_<seed>`.

    Raises:
        ValueRuleError: the kind is unknown.
    """
    if kind not in KINDS:
        raise ValueRuleError("kind", kind, f"it must be one of {', '.join(KINDS)}")
    rng = np.random.default_rng([settings.seed, zlib.crc32(kind.encode()), seed])
    name = f"{kind}_{seed}"
    if kind == "lone":
        return _lone_people(name, settings, rng)
    floor, visitors, duration_s = _STAGES[kind](settings, rng)
    closed = kind == "room" or kind == "square"
    occupied = ~floor.free if closed else shown(floor.free, rng)
    model = drawn_model(
        settings.model, visitors.dense, visitors.spacing_m, visitors.reach_m, visitors.leave, rng
    )
    traits = drawn_traits(
        visitors.journeys.group, settings.people, model.collision_free, visitors.dense, visitors.stops, rng
    )
    ground, routes = guidance(floor.free, visitors.target, settings.guidance, rng)
    seconds = (settings.warm_up_s, duration_s)
    trajectories = walked(visitors.journeys, traits, model, ground, routes, seconds, rng)
    return Scene(name, trajectories, OccupancyMap(occupied, np.zeros(2), CELL_M), RECORD_S)


def guidance(
    free: np.ndarray, target: np.ndarray, settings: GuidanceSettings, rng: np.random.Generator
) -> tuple[Ground, Routes]:
    """Obstacles, and routes to the targets; on ground without obstacles they are straight."""
    ground = ground_of(OccupancyMap(~free, np.zeros(2), CELL_M))
    routing = RoutingSettings(
        settings.resolution_m,
        uniform(rng, settings.narrow_m),
        uniform(rng, settings.comfortable_m),
        uniform(rng, settings.slowest),
    )
    if not free.all():
        return ground, routes_to(target, ground, routing)
    nowhere = np.zeros((len(target), 2, 2, 2), dtype=np.float32)  # the kernel then walks straight
    return ground, Routes(target, np.zeros(2), routing.resolution_m, nowhere)


def walked(
    journeys: Journeys,
    traits: Traits,
    model: WalkingModel,
    ground: Ground,
    routes: Routes,
    seconds: tuple[float, float],
    rng: np.random.Generator,
) -> Trajectories:
    """Let people walk and record them.

    Args:
        journeys: of all people.
        traits: of all people.
        model: how they walk.
        ground: obstacles.
        routes: to the targets.
        seconds: warm-up, which is not recorded, and recorded time.
        rng: source of all randomness.
    """
    every, skipped = round(RECORD_S / STEP_S), round(seconds[0] / RECORD_S)
    steps = (skipped + round(seconds[1] / RECORD_S)) * every
    clock = Clock(STEP_S, steps, every, every)
    before = State.before(journeys)
    record, person, leg, state = walk(journeys, before, traits, model, clock, ground, routes, rng)
    kept = record >= skipped
    record, person, leg, state = record[kept] - skipped, person[kept], leg[kept], state[kept]
    return Trajectories(
        time_s=np.round(record * RECORD_S, 9),
        track_id=person,
        position=state[:, :2],
        velocity=state[:, 2:],
        goal=routes.target[journeys.plan[person, leg]],
        desired_speed_mps=traits.desired_speed[person],
        group_id=journeys.group[person],
    )


def _corridor_stage(settings: WorldSettings, rng: np.random.Generator) -> Stage:
    floor, seconds = corridor(settings.corridor, rng), settings.duration_s
    visitors = streaming(floor, settings.corridor.streams, settings.warm_up_s + seconds, rng)
    return Stage(floor, visitors, seconds)


def _bottleneck_stage(settings: WorldSettings, rng: np.random.Generator) -> Stage:
    floor, seconds = bottleneck(settings.bottleneck, rng), settings.bottleneck_s
    visitors = streaming(floor, settings.bottleneck.streams, settings.warm_up_s + seconds, rng)
    return Stage(floor, visitors, seconds)


def _room_stage(settings: WorldSettings, rng: np.random.Generator) -> Stage:
    floor, seconds = room(settings.room, rng), settings.duration_s
    return Stage(floor, visiting(floor, settings.room.visits, settings.warm_up_s + seconds, rng), seconds)


def _square_stage(settings: WorldSettings, rng: np.random.Generator) -> Stage:
    floor, seconds = square(settings.square, rng), settings.duration_s
    return Stage(floor, strolling(floor, settings.square.strolls, settings.warm_up_s + seconds, rng), seconds)


_STAGES: dict[str, Callable[[WorldSettings, np.random.Generator], Stage]] = {
    "corridor": _corridor_stage,
    "bottleneck": _bottleneck_stage,
    "room": _room_stage,
    "square": _square_stage,
}


def _lone_people(name: str, settings: WorldSettings, rng: np.random.Generator) -> Scene:
    """People far from each other who walk at constant velocities, or stand."""
    count, records = settings.lone.people, round(settings.duration_s / RECORD_S)
    stands = rng.random(count) < settings.lone.standing_share
    slowest, fastest = np.log(settings.lone.speed_mps)
    speed = np.exp(rng.uniform(slowest, fastest, count)) * ~stands
    angle = rng.uniform(0.0, 2 * np.pi, count)
    velocity = np.stack([np.cos(angle), np.sin(angle)], axis=1) * speed[:, None]
    time_s, person = np.repeat(np.arange(records) * RECORD_S, count), np.tile(np.arange(count), records)
    start = np.stack([np.arange(count) * _FAR_M, np.zeros(count)], axis=1)
    trajectories = Trajectories(
        time_s=np.round(time_s, 9),
        track_id=person,
        position=start[person] + velocity[person] * time_s[:, None],
        velocity=velocity[person],
        desired_speed_mps=speed[person],
    )
    nothing = OccupancyMap(np.zeros((1, 1), bool), np.zeros(2), 1.0)
    return Scene(name, trajectories, nothing, RECORD_S)
