"""Memory and time of `pedpred evaluate`: `python -m benchmarks.evaluate --rows 50000 400000`.

People walk at 10 Hz, 20 at a time, in a hall with a wall, each along an arc of its own for 20 s; nearly every
detection is a window. The table shows the peak memory of the process and what each row adds to that of the
first size. Compiled code is stored by the first, smaller run, which is not shown.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.timing import Usage, keep, tell, used
from pedpred.errors import user_errors
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.storage.scenes import write_scene
from tools.arguments import count, output

EVERY_S, AT_ONCE, LIFE = 0.1, 20, 200
"""Seconds between two detections, people at a time, detections of each."""
_HALL_M, _NOISE_M, _FIRST_ROWS = 30.0, 0.03, 8_000


def hall(rows: int, seed: int = 0) -> Scene:
    """A scene of so many detections."""
    rng = np.random.default_rng(seed)
    row = np.arange(rows)
    instant, place = row // AT_ONCE, row % AT_ONCE
    born = (instant + place * (LIFE // AT_ONCE)) // LIFE  # one after the other at each of 20 places
    walker = born * AT_ONCE + place
    many = int(walker.max(initial=0)) + 1
    centre, radius_m = rng.uniform(-_HALL_M / 3, _HALL_M / 3, (many, 2)), rng.uniform(2.0, 6.0, many)
    speed_mps, phase = rng.uniform(0.0, 1.6, many), rng.uniform(0.0, 2 * np.pi, many)
    angle = phase[walker] + speed_mps[walker] / radius_m[walker] * instant * EVERY_S
    on_circle = radius_m[walker, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    position = centre[walker] + on_circle + rng.normal(0.0, _NOISE_M, (rows, 2))
    ground = OccupancyMap(np.zeros((300, 300), bool), np.full(2, -_HALL_M / 2), _HALL_M / 300)
    walls = ground.occupied.copy()
    walls[:2] = walls[-2:] = walls[:, :2] = walls[:, -2:] = True
    people = Trajectories(instant * EVERY_S, walker, position)
    return Scene("hall", people, replace(ground, occupied=walls), EVERY_S)


def measured(rows: int, arguments: Sequence[str]) -> Usage:
    """Evaluate a scene of so many detections, with more arguments."""
    with tempfile.TemporaryDirectory() as folder:
        write_scene(hall(rows), Path(folder) / "hall")
        evaluate = [sys.executable, "-m", "pedpred.command", "evaluate", str(Path(folder) / "hall")]
        return used([*evaluate, *(f"--{argument}" for argument in arguments)])


@user_errors()
def main() -> None:
    """Measure every size and print a line for each."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.evaluate",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("--rows", type=count, nargs="+", default=[50_000, 400_000], help="detections")
    parser.add_argument("--arguments", nargs="*", default=[], help="more arguments of `pedpred evaluate`")
    parser.add_argument("--out", type=output, help="write the figures there as JSON")
    given = parser.parse_args()
    least = measured(_FIRST_ROWS, given.arguments)
    lines = []
    for rows in sorted(set(given.rows)):
        usage = measured(rows, given.arguments)
        more = rows - _FIRST_ROWS
        each_kib = 1024 * (usage.peak_mib - least.peak_mib) / more if more else None
        lines.append(
            {"rows": rows, "peak MiB": usage.peak_mib, "KiB per row": each_kib, "CPU s": usage.cpu_s}
        )
    tell("pedpred evaluate", lines)
    keep({"evaluate": lines}, given.out)


if __name__ == "__main__":
    main()
