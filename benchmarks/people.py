"""Simulated people on whom networks are tried: alone, in corridors, and of JuPedSim."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import cycle
from pathlib import Path

import numpy as np
import shapely

from pedpred.scenes import OccupancyMap, Scene
from pedpred.simulation.worlds.lone import LoneSettings, simulate_lone_people

SPEED_MPS, RADIUS_M = 1.3, 3.0
"""Speed of straight and circling walkers, and radius of their circles."""
_WALKERS, _APART_M = 30, 60.0
_LONE_STEP_S = 0.02
_LENGTH_M, _WALL_M, _CELL_M = 50.0, 0.6, 0.05


def straight(time_s: float) -> np.ndarray:
    """Positions of people who walk straight, far from each other, m. [N, 2]."""
    return np.stack([np.full(_WALKERS, SPEED_MPS * time_s), _APART_M * np.arange(_WALKERS)], axis=1)


def circling(time_s: float) -> np.ndarray:
    """Positions of people on circles, far from each other, half of them clockwise, m. [N, 2]."""
    sense = np.where(np.arange(_WALKERS) % 2, 1.0, -1.0)
    angle = sense * SPEED_MPS / RADIUS_M * time_s + np.arange(_WALKERS)
    around = RADIUS_M * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return around + np.array([0.0, _APART_M]) * np.arange(_WALKERS)[:, None]


def turning(turn_radps: float, people: int) -> Scene:
    """People alone on free ground for 20 s, with a turn rate that changes at random, every 0.02 s."""
    never = (1e-6, 1e-6)
    settings = LoneSettings(
        duration_s=20.0,
        people=people,
        standing_share=0.0,
        speed_mps=(0.9, 1.6),
        straight_share=0.0 if turn_radps else 1.0,
        turn_radps=(turn_radps or 1.0,) * 2,
        turn_s=(1.5, 1.5),
        unsteady=never,
        halting_share=0.0,
        halt_rate_hz=never,
        halt_s=(1.0, 1.0),
        relaxation_s=(1.0, 1.0),
    )
    scene = simulate_lone_people(settings, _LONE_STEP_S, f"turning_{turn_radps}", np.random.default_rng(1))
    return replace(scene, trajectories=replace(scene.trajectories, velocity=None))


def corridor(width_m: float) -> OccupancyMap:
    """A straight corridor along x around y = 0; beyond its ends the ground is free."""
    edge_m = width_m / 2 + _WALL_M
    across = (np.arange(round(2 * edge_m / _CELL_M)) + 0.5) * _CELL_M - edge_m
    walls = np.abs(across) > width_m / 2
    return OccupancyMap(np.tile(walls, (round(_LENGTH_M / _CELL_M), 1)), np.array([0.0, -edge_m]), _CELL_M)


JUPEDSIM_MODELS: dict[str, dict[str, int]] = {
    "CollisionFreeSpeedModel": {},
    "AnticipationVelocityModel": {"rng_seed": 1},
    "SocialForceModel": {},
}
"""Models of JuPedSim, with the arguments that make them reproducible."""
_STEP_S, _FRAME_STEPS, _DURATION_S, _PAUSE_S = 0.01, 10, 60.0, 1.0

Way = tuple[shapely.Polygon, shapely.Polygon]
"""Where people enter and leave."""


def geometries() -> dict[str, tuple[shapely.Geometry, Sequence[Way]]]:
    """Walkable ground, and ways across it, m."""
    box = shapely.box
    bottleneck = box(0, 0, 14, 6) - box(8, 0, 8.5, 2.3) - box(8, 3.7, 8.5, 6)
    corner = box(0, 0, 3, 12) | box(0, 9, 12, 12)
    crossing = (box(0, 5, 15, 10) | box(5, 0, 10, 15)) - shapely.Point(7.5, 7.5).buffer(0.6)
    ends = box(0.3, 0.5, 1.3, 3.5), box(14.7, 0.5, 15.7, 3.5)
    east = box(0.3, 5.5, 1.3, 9.5), box(13.7, 5.5, 14.7, 9.5)
    north = box(5.5, 0.3, 9.5, 1.3), box(5.5, 13.7, 9.5, 14.7)
    return {
        "corridor, both ways": (box(0, 0, 16, 4), [ends, ends[::-1]]),
        "corner": (corner, [(box(0.5, 0.3, 2.5, 1.5), box(11, 9.3, 11.7, 11.7))]),
        "bottleneck": (bottleneck, [(box(0.3, 0.5, 1.5, 5.5), box(13, 0.5, 13.7, 5.5))]),
        "crossing with a column": (crossing, [east, north]),
    }


def write_jupedsim(
    model: str, ground: shapely.Geometry, ways: Sequence[Way], out: Path, rng: np.random.Generator
) -> None:
    """Simulate people with JuPedSim, who enter one by one where there is room, into its SQLite file."""
    import jupedsim as peer

    writer = peer.SqliteTrajectoryWriter(output_file=out, every_nth_frame=_FRAME_STEPS)
    walking = getattr(peer, model)(**JUPEDSIM_MODELS[model])
    world = peer.Simulation(model=walking, geometry=ground, dt=_STEP_S, trajectory_writer=writer)
    stages = [world.add_exit_stage(leaving) for _, leaving in ways]
    journeys = [world.add_journey(peer.JourneyDescription([stage])) for stage in stages]
    person, entering = getattr(peer, f"{model}AgentParameters"), cycle(range(len(ways)))
    for step in range(round(_DURATION_S / _STEP_S)):
        if step % round(_PAUSE_S / _STEP_S) == 0:
            way = next(entering)
            low, high = np.reshape(ways[way][0].bounds, (2, 2))
            position = rng.uniform(low, high)
            if all(np.hypot(*(position - agent.position)) > 0.8 for agent in world.agents()):
                speed_mps = float(np.clip(rng.normal(1.34, 0.26), 0.6, 2.0))
                where = {"position": tuple(position), "journey_id": journeys[way], "stage_id": stages[way]}
                world.add_agent(person(**where, desired_speed=speed_mps))
        world.iterate()
    writer.close()
