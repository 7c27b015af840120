"""How much slower work gets beside busy processes, as a ratio in one run.

A robot's computer runs more than forecasts. Work that starts threads which wait busily slows down many times
beside one busy process; work in one thread loses little.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

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
