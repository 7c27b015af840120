"""The same crowds in other simulators (`pip install pedpred[bench]`).

Both take the obstacles as polygons or segments. JuPedSim (C++) routes people between the same targets as our
simulator; PySocialForce (numba) pulls each person straight towards one of them.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

import numpy as np

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
