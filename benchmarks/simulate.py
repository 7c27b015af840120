"""Simulation speed, compared with JuPedSim and PySocialForce in one run on one thread.

`python -m benchmarks.simulate [--json FILE] [--no-peers]`. The ground consists of tiles of 20 m x 20 m with
eight blocks and twenty people each, so density is constant from 20 to 1000 people. The figure is wall time
per simulated second, each simulator at its own step, without set-up (our routing time is listed separately).

JuPedSim (C++) routes people between the same targets as our simulator; PySocialForce (numba) pulls each
person straight towards one of them. Both are installed by `pip install 'pedpred[bench]'`.
"""

from __future__ import annotations

import argparse
import importlib.util
import logging
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import yaml

from benchmarks.tables import keep, show
from benchmarks.timing import median_ms
from pedpred.errors import user_errors
from pedpred.simulation.crowd import Clock, crowd_of
from pedpred.simulation.ground import ground_of
from pedpred.simulation.kernel import advance
from pedpred.simulation.layouts import Layout, TargetPool, open_cells, scattered
from pedpred.simulation.routing import routes_to
from pedpred.simulation.settings import SocialForceSettings, social_force_settings
from pedpred.simulation.shapes import Rectangle
from pedpred.simulation.simulator import draw_desired_speeds, draw_visiting_plans
from tools.arguments import output

TILE_M = 20.0
BLOCKS = [(3.5, 3.5), (8, 3), (13, 4), (17, 8), (4, 9), (10, 10), (5, 15), (15, 15.5)]
BLOCK_M = (1.6, 1.2)
CROWDS = {"20 in the room": (20, (1, 1)), "200": (200, (5, 2)), "1000": (1000, (10, 5))}
TARGETS = 32
BUDGET_S = 2.0
CHUNK_S = 3.0  # simulated time per call of our simulator

Step = Callable[[], object]
"""Advance all people by one step."""

Corners = Sequence[np.ndarray]
"""Obstacles as polygons, world frame, m; the first one outlines the ground. Each [C, 2]."""


def jupedsim(
    outline: Corners, start: np.ndarray, targets: np.ndarray, speed: np.ndarray
) -> tuple[Step, float]:
    """Helbing, Farkas & Vicsek 2000 in C++, and its default step, s.

    Args:
        outline: ground and obstacles, m.
        start: positions, m. [N, 2]
        targets: visited in turn, m. [G, 2]
        speed: desired, m/s. [N]
    """
    import jupedsim as peer
    import shapely

    ground = shapely.Polygon(outline[0], [ring for ring in outline[1:]])
    dt_s = 0.01
    world = peer.Simulation(model=peer.SocialForceModel(), geometry=ground, dt=dt_s)
    stages = [world.add_waypoint_stage(tuple(target), 0.5) for target in targets]
    journey = peer.JourneyDescription(stages)
    for here, there in zip(stages, np.roll(stages, -1), strict=True):
        journey.set_transition_for_stage(here, peer.Transition.create_fixed_transition(int(there)))
    tour = world.add_journey(journey)
    for n, position in enumerate(start):
        world.add_agent(
            peer.SocialForceModelAgentParameters(
                position=tuple(position),
                journey_id=tour,
                stage_id=stages[n % len(stages)],
                desired_speed=float(speed[n]),
                radius=0.2,
            )
        )
    return world.iterate, dt_s


def pysocialforce(
    outline: Corners, start: np.ndarray, targets: np.ndarray, speed: np.ndarray
) -> tuple[Step, float]:
    """Moussaid et al. 2010 with numba, at its own step of 0.4 s; arguments as in `jupedsim`."""
    logging.disable(logging.INFO)  # it enables the debug messages of all libraries
    import pysocialforce as peer

    logging.getLogger().setLevel(logging.WARNING)
    segments = [
        [x1, x2, y1, y2]
        for ring in outline
        for (x1, y1), (x2, y2) in zip(ring, np.roll(ring, -1, axis=0), strict=True)
    ]
    goal = targets[np.arange(len(start)) % len(targets)]
    way = goal - start
    velocity = speed[:, None] * way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-6)
    world = peer.Simulator(np.hstack([start, velocity, goal]), obstacles=segments)
    return world.step_once, float(world.peds.step_width)


PEERS = {"JuPedSim": jupedsim, "PySocialForce": pysocialforce}


def blocks(tiles: tuple[int, int]) -> np.ndarray:
    """Centres of all blocks, m. [B, 2]."""
    corner = TILE_M * np.stack(np.meshgrid(*map(np.arange, tiles), indexing="ij"), axis=-1).reshape(-1, 1, 2)
    return (corner + np.array(BLOCKS)).reshape(-1, 2)


def world(tiles: tuple[int, int]) -> tuple[Layout, Corners]:
    """The same ground for all simulators."""
    size = TILE_M * np.array(tiles)
    shapes = [Rectangle(center, BLOCK_M) for center in blocks(tiles)]
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    rings = [square * size] + [c + (square - 0.5) * BLOCK_M for c in blocks(tiles)]
    return Layout(tuple(size.tolist()), shapes), rings


def compare(label: str, settings: SocialForceSettings, peers: bool, rng: np.random.Generator) -> list[dict]:
    """Measure one crowd in all simulators."""
    people, tiles = CROWDS[label]
    layout, rings = world(tiles)
    ground = ground_of(layout.occupancy())
    cells = open_cells(ground, settings.crowd.clearance_m)
    targets = scattered(cells, TARGETS, settings.crowd.target_spacing_m, rng)
    start = scattered(cells, people, settings.crowd.spacing_m, rng)
    speed = draw_desired_speeds(people, settings.crowd, rng)
    began = time.perf_counter()
    routes = routes_to(targets, ground, settings.routing)
    routing_s = time.perf_counter() - began
    pool = TargetPool(routes.target, np.arange(len(targets)))
    plan = draw_visiting_plans(pool, people, 400, settings.crowd.least_leg_m, rng)
    crowd = crowd_of(start, np.zeros((people, 2)), speed, plan)
    step_s = settings.clock.step_s
    steps, hold = round(CHUNK_S / step_s), round(settings.clock.noise_hold_s / step_s)
    every = round(settings.clock.record_s / step_s)

    def walk() -> None:
        noise = rng.normal(0.0, settings.clock.noise_mps2, (-(-steps // hold), people, 2))
        clock = Clock(step_s, steps, every, hold)
        advance(crowd, noise, clock, ground, routes, settings.forces, settings.crowd.reach_m)

    walk()  # compile, and accelerate from rest
    walkers: dict[str, tuple[Step, float, float]] = {"ours": (walk, CHUNK_S, step_s)}
    for name, peer in PEERS.items() if peers else ():
        one_step, dt_s = peer(rings, start, targets, speed)
        walkers[name] = one_step, dt_s, dt_s
    took = {
        name: median_ms(step, BUDGET_S, least=1) / simulated_s
        for name, (step, simulated_s, _) in walkers.items()
    }
    return [
        {
            "crowd": label,
            "simulator": name,
            "step_s": dt_s,
            "ms/simulated_s": took[name],
            "pedestrian_steps/s": people / dt_s / took[name] * 1e3,
            "ns/pedestrian_step": took[name] * dt_s / people * 1e6,
            "times_ours": took[name] / took["ours"],
            "routing_s": routing_s if name == "ours" else float("nan"),
        }
        for name, (_, _, dt_s) in walkers.items()
    ]


@user_errors()
def main() -> None:
    """Measure, print, and write the figures if `--json` is given."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.simulate", description=__doc__)
    parser.add_argument("--json", type=output, help="file for the figures")
    parser.add_argument("--no-peers", action="store_true", help="only our simulator")
    options = parser.parse_args()
    missing = [name for name in PEERS if importlib.util.find_spec(name.lower()) is None]
    if missing and not options.no_peers:
        parser.error(
            f"{' and '.join(missing)} not installed: pip install 'pedpred[bench]', or add --no-peers"
        )
    conf = yaml.safe_load((Path(__file__).parents[1] / "conf/social_forces/walking.yaml").read_text())
    settings = social_force_settings(conf["helbing1995"])
    rows = [
        row
        for label in CROWDS
        for row in compare(label, settings, not options.no_peers, np.random.default_rng(0))
    ]
    show("Walking crowds, one thread", rows)
    cost = {row["crowd"]: row["ns/pedestrian_step"] for row in rows if row["simulator"] == "ours"}
    growth = cost["1000"] / cost["20 in the room"]
    figures = {"crowds": rows, "cost_1000_over_20": growth}
    show("Cost of our pedestrian-step", [{"1000 / 20": growth}])
    keep(figures, options.json)


if __name__ == "__main__":
    main()
