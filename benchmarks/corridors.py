"""Straight walkers between walls that are near: `python -m benchmarks.corridors`.

People walk alone along straight corridors at 0.9, 1.2 and 1.5 m/s, at one pace, seen ten times a second with
2 cm of noise. Walls say nothing of people who pass by them: the forecast goes as far as the walker. Where the
map is shifted, people seem to walk inside a wall.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks import pages
from benchmarks.timing import tell
from pedpred.errors import user_errors
from pedpred.online import OnlinePredictor
from pedpred.scenes import OccupancyMap
from tools.arguments import count

WIDTHS_M, SPEEDS_MPS = (0.9, 1.0, 1.2, 1.5, 2.0, 3.0), (0.9, 1.2, 1.5)
FROM_WALL_M = 0.25
"""As near to a wall as people walk, and as far inside of it."""
_RATE_HZ, _NOISE_M, _FRAMES = 10.0, 0.02, 60
_LENGTH_M, _WALL_M, _CELL_M = 50.0, 0.6, 0.05


def corridor(width_m: float) -> OccupancyMap:
    """A straight corridor along x around y = 0; beyond its ends the ground is free."""
    edge_m = width_m / 2 + _WALL_M
    across = (np.arange(round(2 * edge_m / _CELL_M)) + 0.5) * _CELL_M - edge_m
    walls = np.abs(across) > width_m / 2
    return OccupancyMap(np.tile(walls, (round(_LENGTH_M / _CELL_M), 1)), np.array([0.0, -edge_m]), _CELL_M)


def reach(predictor: OnlinePredictor, aside_m: float, pace_mps: float, rng: np.random.Generator) -> float:
    """How far along the corridor a walker is forecast to come, as a share of the way, at the last frame."""
    for frame in range(_FRAMES):
        time_s = frame / _RATE_HZ
        here = np.array([[8.0 + pace_mps * time_s, aside_m]])
        forecast = predictor.update(time_s, np.array([1]), here + rng.normal(0, _NOISE_M, (1, 2)))
    return float(
        (forecast.position[0, -1, 0] - here[0, 0])
        / (pace_mps * (predictor.protocol.horizon_steps * predictor.protocol.dt_s))
    )


def mean_reach(model: Path | None, width_m: float, aside_m: float, people: int) -> float:
    """Mean share over paces and people; each person is somebody new."""
    shares = []
    for person in range(people):
        for pace_mps in SPEEDS_MPS:
            predictor = OnlinePredictor.load(model)
            predictor.set_map(corridor(width_m))
            shares.append(reach(predictor, aside_m, pace_mps, np.random.default_rng(person)))
    return float(np.mean(shares))


@user_errors()
def main() -> None:
    """Measure and print."""
    parser = pages.table_parser(__doc__)
    parser.add_argument("--people", type=count, default=10, help="of each pace")
    options = pages.table_options(parser, "benchmarks.corridors")
    rows = []
    for width_m in WIDTHS_M:
        aside = {"in the middle": 0.0, f"{FROM_WALL_M} m from a wall": width_m / 2 - FROM_WALL_M}
        aside[f"{FROM_WALL_M} m inside a wall"] = width_m / 2 + FROM_WALL_M
        shares = {name: mean_reach(options.model, width_m, at, options.people) for name, at in aside.items()}
        rows.append({"width, m": f"{width_m:g}"} | shares)
    tell("forecast way / way of the walker", rows)
    if options.write:
        pages.put("corridors", rows)


if __name__ == "__main__":
    main()
