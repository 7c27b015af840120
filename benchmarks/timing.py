"""Measuring and telling: what all benchmarks share."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

_WATCH = (
    "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True); "
    "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
)
"""A small process in between: a child counts the memory of its parent until it has begun."""


def median_ms(function: Callable[[], object], budget_s: float = 1.0) -> float:
    """Median wall time of a call, ms, after one to warm up; at least five calls are measured."""
    function()
    times: list[float] = []
    began = time.perf_counter()
    while len(times) < 5 or time.perf_counter() - began < budget_s:
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return float(np.median(times)) * 1e3


def run_measured(command: Sequence[str], environment: dict[str, str] | None = None) -> tuple[float, float]:
    """Wall time, s, and peak memory of the largest process, MiB, of a command and its children."""
    watched = [sys.executable, "-c", _WATCH, *command]
    start = time.perf_counter()
    done = subprocess.run(watched, env=os.environ | (environment or {}), stdout=subprocess.PIPE, check=True)
    return time.perf_counter() - start, int(done.stdout.split()[-1]) / 1024.0


def tell(title: str, rows: Sequence[dict[str, Any]]) -> None:
    """Print a table; the rows share their keys."""
    cells = [
        list(rows[0]),
        *([f"{v:.4g}" if isinstance(v, float) else str(v) for v in r.values()] for r in rows),
    ]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    print(f"\n{title}")
    for line in cells:
        print("  " + "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)))


def keep(figures: dict[str, Any], path: Path | None) -> None:
    """Write the figures as JSON, when a path is given."""
    if path is not None:
        path.write_text(json.dumps(figures, indent=1) + "\n")
