"""Milliseconds per update of the online predictor: tracker, features, network, joint choice and bookkeeping.

`python -m benchmarks.online [--model models/online/default] [--json FILE]`. One thread, every frame a new
detection of all people, 0.3 s apart, so that each frame takes a remembered step of a recurrent network. The
bound is the multiply-adds of the paper's network (`lstm` with its convolutions, which are two thirds of them)
at the matrix rate that numpy reaches here; an update may take 1.5 times that for 20 people and 1.05 times
for 200. Beside it: where the time goes, the network in torch, eager, without features, and the paper's 51 ms
for 20 pedestrians on an i7-4810MQ.

`python -m benchmarks.online --busy 2` compares wall and CPU time of updates alone with those beside busy
processes. Threads that wait busily would add to the CPU time.
"""

from __future__ import annotations

from tools.programs import compute_in_one_thread

if __name__ == "__main__":  # before numpy is loaded
    compute_in_one_thread()

import argparse
import logging
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from benchmarks.tables import keep, show
from benchmarks.timing import median_ms, slowdown
from pedpred.errors import user_errors
from pedpred.online.network import read_origin
from tools.arguments import count, output
from tools.latency import ALLOWED, best_updates, multiply_adds, paper_work, step_of, update_times

CROWDS = (1, 20, 200, 1000)
PAPER_MS = {20: 51.0}
FEW = (4, 20)


def rows_of(folder: Path) -> list[dict[str, Any]]:
    """A row for each crowd."""
    work = paper_work()
    network, step = step_of(read_origin(folder)["network"])
    own = multiply_adds(network, step)
    rows = []
    for people in CROWDS:
        rate, times = best_updates(folder, people, 410 if people <= 20 else 60)
        median = {name: float(np.median(values)) for name, values in times.items()}
        p99, bound = float(np.percentile(times["update"], 99)), people * work / rate * 1e3
        rows.append(
            {
                "pedestrians": people,
                "GFLOP/s": 2e-9 * rate,
                "median_ms": median["update"],
                "p99_ms": p99,
                "p99/median": p99 / median["update"],
                **{f"{name}_ms": median[name] for name in ("features", "network", "choice")},
                "own_bound_ms": people * own / rate * 1e3,
                "bound_ms": bound,
                "median/bound": median["update"] / bound,
                "allowed": ALLOWED.get(people, ""),
                "torch_eager_ms": median_ms(partial(step, people)),
                "paper_ms": PAPER_MS.get(people, ""),
            }
        )
    return rows


def beside_rows(folder: Path, processes: int) -> list[dict[str, Any]]:
    """Wall and CPU time of updates alone and beside busy processes, for few people."""
    rows = []
    for people in FEW:
        for clock in ("update", "cpu"):
            times = slowdown(lambda n=people, key=clock: update_times(folder, n, 110)[key], processes)
            rows.append({"pedestrians": people, "time": "CPU" if clock == "cpu" else "wall"} | times)
    return rows


@user_errors()
def main() -> None:
    """Measure, print, and keep the figures when asked to."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.online", description=__doc__)
    parser.add_argument("--model", type=Path, default=Path("models/online/default"))
    parser.add_argument("--json", type=output, help="write the figures there")
    parser.add_argument("--busy", type=count, metavar="N", help="alone and beside so many busy processes")
    options = parser.parse_args()
    if options.busy:
        beside = beside_rows(options.model, options.busy)
        show("An update alone and beside busy processes, one thread", beside)
        keep({"beside": beside}, options.json)
        return
    torch.set_num_threads(1)
    rows = rows_of(options.model)
    show("An update, one thread; GFLOP/s of matrix products", rows)
    keep({"updates": rows}, options.json)


if __name__ == "__main__":
    logging.disable(logging.WARNING)  # about people who are drawn inside obstacles
    main()
