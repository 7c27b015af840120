"""People of another simulator, whom no network was trained on: `python -m benchmarks.other_people [--write]`.

JuPedSim (`pip install 'pedpred[bench]'`) lets people walk between walls by each of its models; the network
reads the file that JuPedSim writes. Positions are exact, ten a second.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle, product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import shapely

from benchmarks import pages
from benchmarks.accuracy import ade_m
from benchmarks.timing import tell
from pedpred.command.recordings import open_scene
from pedpred.errors import user_errors
from pedpred.online.settings import OnlineSettings

MODELS: dict[str, dict[str, int]] = {
    "CollisionFreeSpeedModel": {},
    "AnticipationVelocityModel": {"rng_seed": 1},
    "SocialForceModel": {},
}
"""Of JuPedSim, with what they need to give the same people again."""
_STEP_S, _FRAME_STEPS, _DURATION_S, _PAUSE_S = 0.01, 10, 60.0, 1.0

Way = tuple[shapely.Polygon, shapely.Polygon]
"""Where people enter and leave."""


def geometries() -> dict[str, tuple[shapely.Geometry, Sequence[Way]]]:
    """Walkable ground and ways of each geometry, m."""
    box = shapely.box
    bottleneck = box(0, 0, 14, 6) - box(8, 0, 8.5, 2.3) - box(8, 3.7, 8.5, 6)
    corner = box(0, 0, 3, 12) | box(0, 9, 12, 12)
    crossing = box(0, 5, 15, 10) | box(5, 0, 10, 15)
    crossing -= shapely.Point(7.5, 7.5).buffer(0.6)
    ends = box(0.3, 0.5, 1.3, 3.5), box(14.7, 0.5, 15.7, 3.5)
    return {
        "corridor, both ways": (box(0, 0, 16, 4), [ends, ends[::-1]]),
        "corner": (corner, [(box(0.5, 0.3, 2.5, 1.5), box(11, 9.3, 11.7, 11.7))]),
        "bottleneck": (bottleneck, [(box(0.3, 0.5, 1.5, 5.5), box(13, 0.5, 13.7, 5.5))]),
        "crossing with a column": (
            crossing,
            [
                (box(0.3, 5.5, 1.3, 9.5), box(13.7, 5.5, 14.7, 9.5)),
                (box(5.5, 0.3, 9.5, 1.3), box(5.5, 13.7, 9.5, 14.7)),
            ],
        ),
    }


def simulate(
    model: str, ground: shapely.Geometry, ways: Sequence[Way], out: Path, rng: np.random.Generator
) -> None:
    """Let people enter one by one, where nobody stands, and walk their way; write what JuPedSim writes."""
    import jupedsim as peer

    writer = peer.SqliteTrajectoryWriter(output_file=out, every_nth_frame=_FRAME_STEPS)
    walking = getattr(peer, model)(**MODELS[model])
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


def errors_m(path: Path, model: Path | None) -> dict[str, float]:
    """Errors of the network, alone and with trust, and of simple methods in a file of JuPedSim, m."""
    scene = open_scene(path)
    trusting, alone = (
        ade_m(scene, model, OnlineSettings(0.125, learn_trust=trust)) for trust in (True, False)
    )
    return alone | {"with trust": trusting["network"]}


def rows_of(model: Path | None) -> list[dict[str, str | float]]:
    """One row for each geometry and model of the people."""
    rows: list[dict[str, str | float]] = []
    with TemporaryDirectory() as folder:
        for (name, (ground, ways)), walking in product(geometries().items(), MODELS):
            path = Path(folder, f"{len(rows)}.sqlite")
            simulate(walking, ground, ways, path, np.random.default_rng(len(rows)))
            error = errors_m(path, model)
            best = min(error["cv"], error["kalman_cv"])
            rows.append(
                {
                    "ground": name,
                    "people": walking.removesuffix("Model"),
                    "CV": error["cv"],
                    "Kalman CV": error["kalman_cv"],
                    "network": error["network"],
                    "network / the better": error["network"] / best,
                    "with trust": error["with trust"],
                    "with trust / the better": error["with trust"] / best,
                }
            )
    return rows


@user_errors()
def main() -> None:
    """Simulate, measure, print, and write the table if asked."""
    options = pages.table_options(pages.table_parser(__doc__), "benchmarks.other_people")
    rows = rows_of(options.model)
    tell("ADE, m", rows)
    if options.write:
        pages.put("other_people", rows)


if __name__ == "__main__":
    main()
