"""Samples per second of the training loop, beside what the machine's matrix rate allows.

`python -m benchmarks.train [--device cuda] [--json FILE]`. A sample is one step of one lane, or one situation
of a network without memory. Data are random, sizes are those of params.yaml (`methods`, `training`); a step
includes the look-up and the augmentation of its data. All times of a row are taken in turn, round after
round, and the medians compared, so that a machine that is busy elsewhere slows all alike.

Operations per sample of a recurrent network: a product with a weight matrix of n entries takes 2 n, forward,
and as much again for each gradient: of the weights, and of its input unless that is data. So 6 sum(n) - 2
sum(n of the layers that read data). Those of a network without memory are counted while it computes.
`of_rate` is the share of the best large product's rate that a step reaches; `of_products` compares it with
the time that the same products take alone, at the sizes and in the order that the network forces.

`python -m benchmarks.train --busy 1` compares steps of two threads alone with those beside busy processes,
with threads that sleep while they wait (`OMP_WAIT_POLICY=PASSIVE`, as the stages set it) and that spin.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import torch

from benchmarks.beside import slowdown
from benchmarks.learners import Case, cases
from benchmarks.timing import keep, tell
from pedpred.errors import user_errors
from pedpred.training.distributed import DistributedContext, distributed_context, multiplies_bfloat16
from pedpred.training.loop import train_step
from tools.arguments import count, output

ROUNDS = 15
LARGE = 2048
WAITING = {"sleep": "PASSIVE", "spin": "ACTIVE"}
BESIDE = "mixture"
STEPS, LONGEST_S = 10, 10.0
"""Measured in a row; fewer where they take long."""


def in_turn(works: dict[str, Callable[[], Any]], device: torch.device) -> dict[str, np.ndarray]:
    """Seconds of every work in every round, after one round to warm up. [ROUNDS] each."""
    took: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(ROUNDS + 1):
        for name, work in works.items():
            _wait(device)
            start = time.perf_counter()
            work()
            _wait(device)
            took[name].append(time.perf_counter() - start)
    return {name: np.array(times[1:]) for name, times in took.items()}


def _wait(device: torch.device) -> None:
    if device.type == "cuda":
        torch.cuda.synchronize()


def measured(name: str, case: Case, here: DistributedContext) -> dict[str, Any]:
    """One row of the table: a network on the machine with the present number of threads."""
    batches = case.learner.batches(0)
    square = torch.rand(LARGE, LARGE, device=here.device)
    works: dict[str, Callable[[], Any]] = {
        "rate": lambda: square @ square,
        "step": lambda: train_step(case.learner, next(batches), 0),
        "load": lambda: case.load(next(batches)),
        "update": case.learner.optimizer.step,
    }
    if case.products is not None:
        works["products"] = case.products
    with here.precision():
        took = in_turn(works, here.device)
    rate = 2 * LARGE**3 / took["rate"]
    middle = {k: float(np.median(v)) * 1e3 for k, v in took.items()}
    alone = case.products is not None
    return {
        "model": name,
        "products": "bfloat16" if here.autocast else "float32",
        "threads": torch.get_num_threads(),
        "MFLOP/sample": case.operations / 1e6,
        "best_GFLOP/s": float(np.median(rate)) / 1e9,
        "step_ms": middle["step"],
        "steps/s": 1e3 / middle["step"],
        "samples/s": case.samples / middle["step"] * 1e3,
        "of_rate": float(np.median(case.samples * case.operations / took["step"] / rate)),
        "of_products": float(np.median(took["products"] / took["step"])) if alone else "",
        "products_ms": middle["products"] if alone else "",
        "load_ms": middle["load"],
        "update_ms": middle["update"],
    }


def beside(processes: int) -> Iterator[dict[str, Any]]:
    """Steps beside busy processes; how threads wait is read when a process starts, hence processes."""
    script = f"from benchmarks.train import print_slowdown; print_slowdown({processes})"
    for waiting, policy in WAITING.items():
        environment = os.environ | {"OMP_WAIT_POLICY": policy, "OMP_NUM_THREADS": "2"}
        done = subprocess.run(
            [sys.executable, "-c", script], env=environment, stdout=subprocess.PIPE, check=True
        )
        yield {"model": BESIDE, "threads": waiting} | json.loads(done.stdout)


def print_slowdown(processes: int) -> None:
    """Print `slowdown` of a network's steps as JSON."""
    with distributed_context("cpu", "auto") as here:
        case = cases()[BESIDE](here)
        batches = case.learner.batches(0)

        def steps_ms() -> np.ndarray:
            times = [time.perf_counter()]
            while len(times) <= STEPS and times[-1] - times[0] < LONGEST_S:
                train_step(case.learner, next(batches), 0)
                times.append(time.perf_counter())
            return np.diff(times) * 1e3

        steps_ms()  # warm
        print(json.dumps(slowdown(steps_ms, processes)))


@user_errors()
def main() -> None:
    """Measure, print, and keep the figures when asked to."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.train", description=__doc__)
    parser.add_argument("--json", type=output, help="write the figures there")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu")
    parser.add_argument(
        "--busy", type=count, metavar="N", help="only beside so many busy processes, and alone"
    )
    options = parser.parse_args()
    if options.busy:
        rows = list(beside(options.busy))
        tell("Training step alone and beside busy processes, two threads", rows)
        keep({"beside": rows}, options.json)
        return
    rows = []
    for narrow in (False, True):
        with distributed_context(options.device, narrow) as here:
            if narrow and not multiplies_bfloat16(here.device):
                print(f"bfloat16 is left out: this {options.device} has no units for it")
                continue
            for threads in (1, 2) if options.device == "cpu" else (1,):
                torch.set_num_threads(threads)
                rows += [measured(name, make(here), here) for name, make in cases().items()]
    tell("Training step", rows)
    keep({"train": rows}, options.json)


if __name__ == "__main__":
    main()
