"""Times of calls, alone and beside busy processes."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

_ROUNDS = 3


def median_ms(function: Callable[[], object], budget_s: float = 1.0, least: int = 5) -> float:
    """Measure the median wall time of a call, ms, after one warm-up call; of at least so many calls."""
    function()
    times: list[float] = []
    began = time.perf_counter()
    while len(times) < least or time.perf_counter() - began < budget_s:
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return float(np.median(times)) * 1e3


@contextmanager
def busy(processes: int) -> Iterator[list[subprocess.Popen]]:
    """Run so many processes that compute without end."""
    command = [sys.executable, "-c", "while True: pass"]
    started = [subprocess.Popen(command) for _ in range(processes)]
    try:
        yield started
    finally:
        for process in started:
            process.kill()
            process.wait()


def slowdown(times_ms: Callable[[], np.ndarray], processes: int) -> dict[str, float]:
    """Compare median times alone and beside busy processes, measured in turn.

    Args:
        times_ms: does the work several times; returns how long each took, ms. [N]
        processes: number of busy processes.
    """
    alone, beside = [], []
    for _ in range(_ROUNDS):
        alone.append(times_ms())
        with busy(processes):
            beside.append(times_ms())
    one, other = (float(np.median(np.concatenate(times))) for times in (alone, beside))
    return {"alone_ms": one, "busy_processes": processes, "beside_them_ms": other, "ratio": other / one}
