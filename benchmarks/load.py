"""Memory and throughput of the stages at several sizes: `python -m benchmarks.load --hours 5 50`.

Every stage up to one epoch of training runs as in the pipeline, in a temporary folder: first with one
minute of simulation (twice, since the first run compiles), then with each given size, at 60 rooms per hour
as in the default configuration. Half of the rooms are for validation, so that its blocks of 256 tracks are
full from half an hour (300 tracks) on. The table shows the peak anonymous memory of a stage's processes and
the rows per CPU second beyond those of the minute, then the ratio of both between the last size and the
first. Anonymous memory excludes pages of mapped files, which the system evicts under memory pressure
(`benchmarks.watch`; Linux only). CPU seconds are summed over all threads, so that other load on the machine
matters little.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from benchmarks.timing import Usage, keep, tell, used
from pedpred.errors import user_errors
from tools.arguments import output, positive

ROOT = Path(__file__).resolve().parents[1]
MINUTE_H = 1 / 60
ROOMS_PER_HOUR = 60
LANES, SUB_SEQUENCE = 64, 10
"""As in conf/training, of the phase that starts from an auto-encoder."""
HELD_OUT = 0.5  # of the rooms, for validation
EPOCH = "train, one epoch"
Size = tuple[int, dict[str, Usage]]
"""Rows of a simulation, and the resources that each stage used on it."""


def commands(hours: float) -> dict[str, list[str]]:
    """The stages before training, with the overrides that set their size."""
    rooms = max(2, round(ROOMS_PER_HOUR * hours))
    return {
        "simulate": ["+name=main", f"simulations.main.hours={hours}", f"simulations.main.generated={rooms}"],
        "features": ["+kind=simulated", "+name=main"],
        "pretrain_autoencoder": ["autoencoder.steps=5", "autoencoder.validate_every=5"],
        "encode": ["+kind=simulated", "+name=main"],
    }


def epoch(rows: int) -> list[str]:
    """Overrides that train for one epoch, validated before and after."""
    steps = math.ceil((1 - HELD_OUT) * rows / (LANES * SUB_SEQUENCE))
    lengths = [f"training.corridor.{key}={steps}" for key in ("steps", "validate_every")]
    sizes = [f"training.corridor.lanes={LANES}", f"training.corridor.sub_sequence={SUB_SEQUENCE}"]
    sizes.append(f"training.corridor.validation_share={HELD_OUT}")
    sizes.append("training.corridor.sets=[simulated/main]")
    return ["+phase=corridor", "+name=lstm", *lengths, *sizes]


def rows_of(folder: Path) -> int:
    """Count the rows of all feature shards."""
    shards = (folder / "data/features/simulated/main").glob("*.parquet")
    return sum(pq.read_metadata(shard).num_rows for shard in shards)


def measured(hours: float, stages: Sequence[str]) -> Size:
    """Run these stages at one size, in a temporary folder."""
    outer = {k: v for k, v in os.environ.items() if not k.startswith("DVC_")}
    alone = {"PYTHONPATH": str(ROOT), "PEDPRED_JOBS": "1"}  # all in one process, to measure its memory
    environment = outer | alone
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)

        def run(stage: str, overrides: list[str]) -> Usage:
            return used([sys.executable, "-m", f"stages.{stage}", *overrides], folder, environment)

        usage = {stage: run(stage, commands(hours)[stage]) for stage in stages if stage != EPOCH}
        rows = rows_of(folder)
        return rows, usage | ({EPOCH: run("train", epoch(rows))} if EPOCH in stages else {})


def compared(sizes: dict[float, Size], least: Size) -> list[dict[str, Any]]:
    """Make one line per stage and size; those of the last size have the ratios to the first."""
    first, last = min(sizes), max(sizes)

    def speed(stage: str, hours: float) -> float:
        rows, usage = sizes[hours]
        return (rows - least[0]) / (usage[stage].cpu_s - least[1][stage].cpu_s)

    def anonymous(stage: str, hours: float) -> float:
        return sizes[hours][1][stage].anonymous_mib or math.nan

    lines = []
    for stage in least[1]:
        fixed = stage == "pretrain_autoencoder"  # as many steps at every size
        for hours, (rows, _) in sizes.items():
            line = {"stage": stage, "hours": hours, "rows": rows, "anonymous MiB": anonymous(stage, hours)}
            line["rows per CPU s"] = "" if fixed else speed(stage, hours)
            again = hours == last and last > first
            line["memory x"] = anonymous(stage, last) / anonymous(stage, first) if again else ""
            line["speed x"] = speed(stage, last) / speed(stage, first) if again and not fixed else ""
            lines.append(line)
    return lines


@user_errors()
def main() -> None:
    """Measure and print."""
    every = [*commands(MINUTE_H), EPOCH]
    parser = argparse.ArgumentParser(prog="python -m benchmarks.load", description=__doc__)
    parser.add_argument("--hours", type=positive, nargs="+", default=[5.0, 50.0], help="of simulation")
    parser.add_argument("--until", choices=every[1:], default=EPOCH, help="the last stage to run")
    parser.add_argument("--json", type=output)
    given = parser.parse_args()
    stages = every[: every.index(given.until) + 1]
    least = [measured(MINUTE_H, stages) for _ in range(2)][-1]
    lines = compared({hours: measured(hours, stages) for hours in sorted(given.hours)}, least)
    tell("a larger simulation", lines)
    keep({"load": lines}, given.json)


if __name__ == "__main__":
    main()
