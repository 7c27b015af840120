"""Simulate the recording that stands in for real ones: `python -m tools.stand_in`.

People walk round a corner of a simulated world that no network was trained in, and a sensor sees them 2.5
times a second with an error of 3 cm. The scene folder goes to examples/simulated_corner, or to `--out`.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from pedpred.config import read_params
from pedpred.errors import user_errors
from pedpred.files import check_output, write_json, write_text
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.simulation.sensor import SensorSettings, apply_sensor
from pedpred.simulation.worlds import simulate_world
from pedpred.storage.scenes import SCENE_SCHEMA, write_map
from stages.worlds import worlds_of

ROOT = Path(__file__).resolve().parents[1]
FOLDER = Path("examples/simulated_corner")
SEED = 2018
"""Training draws its worlds from another seed."""
KIND, NUMBER, DURATION_S = "corridor", 11, 48.0
SENSOR = SensorSettings(rate_hz=2.5, position_noise_m=0.03, seed=7)
MADE = "simulated people, written by `python -m tools.stand_in`"
AROUND_M = 5.0
"""Kept of the map around all people: farther than the corners of a crop of a network reach."""


def stand_in(name: str) -> Scene:
    """Simulate the people and look at them."""
    ranges, _ = worlds_of(read_params(ROOT))
    longer = replace(ranges.corridor, duration_s=DURATION_S)
    world = simulate_world(KIND, NUMBER, replace(ranges, seed=SEED, corridor=longer))
    seen = apply_sensor(world, SENSOR, np.random.default_rng(SENSOR.seed))
    kept = Trajectories(*(getattr(seen.trajectories, key) for key in ("time_s", "track_id", "position")))
    return Scene(name, kept, around(world.occupancy, kept.position), seen.detection_dt_s, stand_in=MADE)


def around(occupancy: OccupancyMap, position: np.ndarray) -> OccupancyMap:
    """Cut off what is farther than `AROUND_M` from all people along an axis. position: [M, 2]."""
    cell_m = occupancy.resolution_m
    low = np.maximum(np.floor((position.min(axis=0) - AROUND_M - occupancy.origin) / cell_m), 0).astype(int)
    high = np.ceil((position.max(axis=0) + AROUND_M - occupancy.origin) / cell_m).astype(int)
    occupied = occupancy.occupied[low[0] : high[0], low[1] : high[1]]
    return OccupancyMap(occupied, occupancy.origin + cell_m * low, cell_m)


def write_small(scene: Scene, folder: Path) -> None:
    """Write a scene folder as text: millimetres and hundredths of a second suffice."""
    rows = scene.trajectories
    columns = zip(rows.time_s.tolist(), rows.track_id.tolist(), rows.position.tolist(), strict=True)
    lines = [f"{time_s:.2f},{track},{x:.3f},{y:.3f}\n" for time_s, track, (x, y) in columns]
    write_text(folder / "tracks.csv", "".join(["time,id,x,y\n", *lines]))
    write_map(scene.occupancy, folder)
    about = {"schema": SCENE_SCHEMA, "name": scene.name, "detection_dt_s": scene.detection_dt_s}
    write_json(folder / "scene.json", about | {"stand_in": scene.stand_in})


@user_errors()
def main(arguments: list[str] | None = None) -> None:
    """Simulate and write."""
    parser = argparse.ArgumentParser(prog="python -m tools.stand_in", description=__doc__)
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder (default: %(default)s)")
    out = parser.parse_args(arguments).out
    check_output(out, folder=True)
    write_small(stand_in(FOLDER.name), out)


if __name__ == "__main__":
    main()
