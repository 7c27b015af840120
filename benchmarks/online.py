"""Milliseconds per update of the online predictor: tracker, both grids, network and bookkeeping.

`python -m benchmarks.online [--model models/online/simulation] [--json FILE]`. One thread, every frame a
new detection of everybody, 0.3 s apart, so that each frame takes a remembered step. The bound is the
network's multiply-adds at the matrix rate that numpy reaches here; the convolutions are two thirds of them.
Beside it: the distilled export (<model>_distilled), the full network in torch, eager, without features,
and the paper's 51 ms for 20 pedestrians on an i7-4810MQ. `--hour` shows that memory stays flat.

`python -m benchmarks.online --replay` compares forecasts instead of times, see `benchmarks.replay`.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", NUMBA_NUM_THREADS="1")

import argparse
import json
import resource
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import torch
from torch import nn

from benchmarks.features import room
from benchmarks.replay import differences
from benchmarks.timing import keep, median_ms, tell
from pedpred.networks import GridEncoder, parse_settings
from pedpred.online import OnlinePredictor

CROWDS = (1, 20, 200, 1000)
PAPER_MS = {20: 51.0}


def matrix_rate(size: int = 1024) -> float:
    """Multiply-adds a second of a single-precision matrix product on one thread."""
    a = np.random.default_rng(0).random((size, size), dtype=np.float32)
    return size**3 / (median_ms(lambda: a @ a) * 1e-3)


def model_of(folder: Path) -> tuple[nn.Module, Callable[[int], None]]:
    """A network like the exported one, and one step of it for so many people, convolutions included."""
    about = json.loads((folder / "model.json").read_text())
    origin, cells = about["origin"], about["features"]["grid_cells"]
    network = parse_settings(origin["network"]).build(origin["widths"], origin["horizon_steps"]).eval()
    whole = nn.ModuleDict({"network": network, "encoder": GridEncoder(cells)})

    @torch.inference_mode()
    def step(count: int) -> None:
        inputs = {name: torch.zeros(count, 1, width) for name, width in network.widths.items()}
        if "grid" in inputs:
            inputs["grid"] = whole["encoder"].embedding(torch.zeros(count, cells, cells))[:, None]
        network(inputs, network.start(count))

    return whole, step


def multiply_adds(network: nn.Module, step: Callable[[int], None]) -> int:
    """Of one pedestrian's step: every weight of a matrix once, of a convolution once per output cell."""
    total = 0

    def count(layer: nn.Module, inputs: object, output: object) -> None:
        nonlocal total
        cells = output[0, 0].numel() if isinstance(layer, nn.Conv2d) else 1
        total += sum(w.numel() for w in layer.parameters(recurse=False) if w.dim() > 1) * cells

    hooks = [layer.register_forward_hook(count) for layer in network.modules()]
    step(1)
    for hook in hooks:
        hook.remove()
    return total


def walkers(count: int, rng: np.random.Generator, frames: int) -> list[np.ndarray]:
    """Positions of a crowd that walks through a room of 20 m x 20 m, frame by frame. [count, 2] each."""
    start, velocity = rng.uniform(0.0, 20.0, (count, 2)), rng.normal(0.0, 1.0, (count, 2))
    return [(start + velocity * 0.3 * k) % 20.0 for k in range(frames)]


def update_times_ms(folder: Path, count: int, frames: int) -> np.ndarray:
    """Wall time of every update but the first ones. [frames - 10]."""
    rng = np.random.default_rng(0)
    robot = OnlinePredictor.load(folder)
    robot.set_map(room(rng))
    ids, times = np.arange(count), []
    for k, position in enumerate(walkers(count, rng, frames)):
        begin = time.perf_counter()
        robot.update(0.3 * k, ids, position)
        times.append(time.perf_counter() - begin)
    return np.array(times[10:]) * 1e3


def traffic_rows(folder: Path, minutes: int = 60, dt_s: float = 0.3) -> Iterator[dict[str, float]]:
    """Memory of the process during an hour of people who come and go, a dozen at a time.

    Somebody new comes every 2.1 s with an id never seen before and leaves after 25 s.
    """
    rng = np.random.default_rng(0)
    robot = OnlinePredictor.load(folder)
    robot.set_map(room(rng))
    every, life = 7, round(25.0 / dt_s)
    people = minutes * 60
    start, velocity = rng.uniform(1.0, 19.0, (people, 2)), rng.uniform(-1.0, 1.0, (people, 2))
    for k in range(round(minutes * 60 / dt_s) + 1):
        ids = np.arange(max(0, (k - life) // every + 1), k // every + 1)
        age_s = (k - ids * every)[:, None] * dt_s
        forecast = robot.update(dt_s * k, ids, start[ids] + velocity[ids] * age_s)
        if k * dt_s % 600 < dt_s / 2 and k:
            pages = int(Path("/proc/self/statm").read_text().split()[1])
            rss_mib = pages * resource.getpagesize() / 2**20
            yield {
                "minute": k * dt_s / 60,
                "met": int(ids[-1]) + 1,
                "there": len(forecast),
                "rss_mib": rss_mib,
            }


def main() -> None:
    """Measure, print, and keep the figures when asked to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", type=Path, default=Path("models/online/simulation"))
    parser.add_argument("--json", type=Path, help="write the figures there")
    parser.add_argument("--hour", action="store_true", help="also the memory during an hour (a minute)")
    parser.add_argument("--replay", action="store_true", help="online beside offline forecasts, no times")
    options = parser.parse_args()
    if options.replay:
        rows = list(differences(options.model.parent))
        tell("Online and offline forecasts of the same windows, largest distance at any step", rows)
        keep({"replay": rows}, options.json)
        return
    torch.set_num_threads(1)
    network, step = model_of(options.model)
    work = multiply_adds(network, step)
    rate, distilled = matrix_rate(), options.model.with_name(f"{options.model.name}_distilled")
    rows = []
    for count in CROWDS:
        times = update_times_ms(options.model, count, 1010 if count <= 20 else 110)
        bound = count * work / rate * 1e3
        rows.append(
            {
                "pedestrians": count,
                "median_ms": float(np.median(times)),
                "p99_ms": float(np.percentile(times, 99)),
                "p99/median": float(np.percentile(times, 99) / np.median(times)),
                "distilled_ms": float(np.median(update_times_ms(distilled, count, 110))),
                "bound_ms": bound,
                "median/bound": float(np.median(times)) / bound,
                "torch_eager_ms": median_ms(partial(step, count)),
                "paper_ms": PAPER_MS.get(count, float("nan")),
            }
        )
    tell(f"An update, one thread ({2e-9 * rate:.0f} GFLOP/s in matrix products)", rows)
    figures = {"updates": rows, "multiply_adds_per_s": rate}
    if options.hour:
        figures["hour"] = list(traffic_rows(options.model))
        tell("An hour of people who come and go", figures["hour"])
    keep(figures, options.json)


if __name__ == "__main__":
    main()
