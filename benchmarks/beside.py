"""How much slower work gets beside busy processes, as a ratio in one run.

`python -m benchmarks.beside` compares the CPU time of an update of the default model, to which threads that
wait busily would add, alone and beside two busy processes.

A robot's computer runs more than forecasts. Work that starts threads which wait busily slows down many times
beside one busy process; work in one thread loses little.
"""

from __future__ import annotations

import itertools
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from benchmarks.timing import tell
from pedpred.errors import user_errors
from pedpred.online import OnlinePredictor
from tools.arguments import no_arguments

ROUNDS = 3


@contextmanager
def busy(processes: int) -> Iterator[list[subprocess.Popen]]:
    """Let so many processes compute without end."""
    command = [sys.executable, "-c", "while True: pass"]
    started = [subprocess.Popen(command) for _ in range(processes)]
    try:
        yield started
    finally:
        for process in started:
            process.kill()
            process.wait()


def slowdown(times_ms: Callable[[], np.ndarray], processes: int) -> dict[str, float]:
    """Median times alone and beside busy processes, in turn, round after round.

    Args:
        times_ms: does the work several times; how long each took, ms. [N]
        processes: that are busy.
    """
    alone, beside = [], []
    for _ in range(ROUNDS):
        alone.append(times_ms())
        with busy(processes):
            beside.append(times_ms())
    one, other = (float(np.median(np.concatenate(times))) for times in (alone, beside))
    return {"alone_ms": one, "busy_processes": processes, "beside_them_ms": other, "ratio": other / one}


def updates_cpu_ms(count: int, frames: int = 100) -> Callable[[], np.ndarray]:
    """Make what updates the default model with so many people and returns the CPU time of each update, ms."""
    predictor, places = OnlinePredictor.load(), np.random.default_rng(0).uniform(0, 10, (count, 2))
    stamps = (0.1 * frame for frame in itertools.count())

    def update_ms() -> float:
        before = time.process_time()
        predictor.update(next(stamps), np.arange(count), places)
        return (time.process_time() - before) * 1e3

    def times_ms() -> np.ndarray:
        return np.array([update_ms() for _ in range(frames)])

    times_ms()  # warm
    return times_ms


@user_errors()
def main() -> None:
    """Measure and print."""
    rows = [{"people": count} | slowdown(updates_cpu_ms(count), processes=2) for count in (4, 20)]
    tell("CPU time of an update alone and beside busy processes", rows)


if __name__ == "__main__":
    no_arguments("benchmarks.beside", __doc__)
    main()
