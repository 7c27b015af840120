"""Measure time and memory, print tables: shared by all benchmarks."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.files import write_json

_WATCH = Path(__file__).with_name("watch.py")


@dataclass(frozen=True)
class Usage:
    """Resources that a command and all its children used.

    Attributes:
        wall_s: from its start to its end, s.
        cpu_s: CPU time of all processes and threads, s.
        peak_mib: peak memory of the largest process, with mapped files, MiB.
        anonymous_mib: peak memory of all processes together, without mapped files, MiB; see
            `benchmarks.watch`.
    """

    wall_s: float
    cpu_s: float
    peak_mib: float
    anonymous_mib: float | None


def needed(path: Path, command: str) -> Path:
    """A path that is not in git; ends the program with the command that makes it, if that has not run."""
    if not path.exists():
        sys.exit(f"{path} is missing; make it: {command}")
    return path


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


def used(
    command: Sequence[str], folder: Path | None = None, environment: Mapping[str, str] | None = None
) -> Usage:
    """Run a command in a folder and measure it."""
    watched = [sys.executable, str(_WATCH), *command]
    start = time.perf_counter()
    done = subprocess.run(watched, cwd=folder, env=environment, stdout=subprocess.PIPE, check=True)
    return Usage(time.perf_counter() - start, **json.loads(done.stdout))


def run_stage(stage: str, *overrides: str) -> dict[str, float]:
    """Run a stage as in the pipeline, by two workers; wall time, and memory beside that of its parent."""
    command = [sys.executable, "-m", f"stages.{stage}", *overrides]
    usage = used(command, environment=os.environ | {"PEDPRED_JOBS": "2"})
    return {
        "seconds": usage.wall_s,
        "largest_process_mib": usage.peak_mib,
        "three_processes_at_most_mib": 3 * usage.peak_mib,
    }


def tell(title: str, rows: Sequence[dict[str, Any]]) -> None:
    """Print a table; the rows share their keys. Without rows it says so."""
    if not rows:
        print(f"\n{title}\n  nothing could be measured")
        return
    cells = [
        list(rows[0]),
        *([f"{v:.4g}" if isinstance(v, float) else str(v) for v in r.values()] for r in rows),
    ]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    print(f"\n{title}")
    for line in cells:
        print("  " + "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)))


def keep(figures: dict[str, Any], path: Path | None) -> None:
    """Write the figures as JSON if a path is given; what is no finite number becomes null."""
    if path is not None:
        write_json(path, _finite(figures))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
