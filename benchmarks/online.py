"""Milliseconds per update of the online predictor: tracker, features, network, joint choice and bookkeeping.

`python -m benchmarks.online [--model models/online/default] [--json FILE]`. One thread, every frame a new
detection of everybody, 0.3 s apart, so that each frame takes a remembered step of a recurrent network. The
bound is the multiply-adds of the paper's network (`lstm` with its convolutions, which are two thirds of them)
at the matrix rate that numpy reaches here; an update may take 1.5 times that for 20 people and 1.05 times
for 200. Beside it: where the time goes, the network in torch, eager, without features, and the paper's 51 ms
for 20 pedestrians on an i7-4810MQ. `--hour` shows that memory stays flat.

`python -m benchmarks.online --busy 2` compares updates alone with those beside busy processes.
`python -m benchmarks.online --replay` compares forecasts instead of times, see `benchmarks.replay`.
"""

from __future__ import annotations

from tools.programs import compute_in_one_thread

if __name__ == "__main__":  # before numpy is loaded
    compute_in_one_thread()

import argparse
import resource
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn
from torch.utils.flop_counter import FlopCounterMode

from benchmarks.beside import slowdown
from benchmarks.features import room
from benchmarks.replay import differences
from benchmarks.timing import keep, median_ms, needed, tell
from pedpred.config import plain, read_params
from pedpred.errors import user_errors
from pedpred.features import ForecastProtocol
from pedpred.models.lstm.autoencoder import GridEncoder
from pedpred.models.lstm.features import LstmFeatures
from pedpred.models.mixture.features import MixtureFeatures
from pedpred.models.registry import parse_settings
from pedpred.online import OnlinePredictor
from pedpred.online.network import read_origin
from tools.arguments import count, output

CROWDS = (1, 20, 200, 1000)
ALLOWED = {20: 1.5, 200: 1.05}
"""Number of people -> how often the bound an update may take."""
PAPER_MS = {20: 51.0}
FEW = (4, 20)
_SIZES = LstmFeatures()


def matrix_rate(size: int = 1024) -> float:
    """Multiply-adds a second of a single-precision matrix product on one thread."""
    a = np.random.default_rng(0).random((size, size), dtype=np.float32)
    return size**3 / (median_ms(lambda: a @ a) * 1e-3)


def step_of(settings: Mapping[str, Any]) -> tuple[nn.Module, Callable[[int], None]]:
    """A network with random weights, and one step of it for so many people, convolutions included."""
    cells, encoder = _SIZES.grid_cells, GridEncoder(_SIZES.grid_cells)
    embedded = encoder.embedding(torch.zeros(1, cells, cells)).shape[1]
    shapes = MixtureFeatures().shapes() | {"grid": (embedded,), "angular": (_SIZES.angular_cells,)}
    widths = {name: width for name, (width,) in shapes.items()}
    network = parse_settings(settings).build(widths, ForecastProtocol().horizon_steps).eval()
    whole = nn.ModuleDict({"network": network, "encoder": encoder})

    @torch.inference_mode()
    def step(count: int) -> None:
        inputs = {name: torch.zeros(count, 1, width) for name, width in network.widths.items()}
        if "grid" in inputs:
            inputs["grid"] = encoder.embedding(torch.zeros(count, cells, cells))[:, None]
        network(inputs, network.start(count))

    return whole, step


def paper_work() -> int:
    """Multiply-adds of one pedestrian's step in the paper's network."""
    return multiply_adds(*step_of(plain(read_params(Path(".")).methods.networks.lstm.settings)))


def multiply_adds(network: nn.Module, step: Callable[[int], None]) -> int:
    """Of one pedestrian's step, as torch counts them; of an LSTM, which it leaves out, every weight once."""
    with FlopCounterMode(display=False) as counted:
        step(1)
    recurrent = [layer for layer in network.modules() if isinstance(layer, nn.LSTM)]
    own = sum(w.numel() for layer in recurrent for w in layer.parameters() if w.dim() > 1)
    return int(counted.get_total_flops()) // 2 + own


def walkers(count: int, rng: np.random.Generator, frames: int) -> list[np.ndarray]:
    """Positions of a crowd that walks through a room of 20 m x 20 m, frame by frame. [count, 2] each."""
    start, velocity = rng.uniform(0.0, 20.0, (count, 2)), rng.normal(0.0, 1.0, (count, 2))
    return [(start + velocity * 0.3 * k) % 20.0 for k in range(frames)]


def update_times_ms(folder: Path, count: int, frames: int) -> np.ndarray:
    """Wall time of every update but the first ones. [frames - 10]."""
    return measured_updates(folder, count, frames)["update"]


def measured_updates(folder: Path, count: int, frames: int) -> dict[str, np.ndarray]:
    """Wall time of every update but the first ones, and of its parts, ms. [frames - 10] each."""
    rng = np.random.default_rng(0)
    robot = OnlinePredictor.load(folder)
    robot.set_map(room(rng))
    times: dict[str, list[float]] = {}
    owners = {
        "features": (robot, "_inputs"),
        "network": (robot._network, "step"),
        "choice": (robot, "_forecast"),
    }
    for name, (owner, method) in owners.items():
        setattr(owner, method, _timed(getattr(owner, method), times.setdefault(name, [])))
    update = _timed(robot.update, times.setdefault("update", []))
    for k, position in enumerate(walkers(count, rng, frames)):
        update(0.3 * k, np.arange(count), position)
    return {name: np.array(own[10:]) for name, own in times.items()}


def _timed(function: Callable[..., Any], times: list[float]) -> Callable[..., Any]:
    """A function that also notes how long each call takes, ms."""

    def call(*arguments: Any) -> Any:
        begin = time.perf_counter()
        result = function(*arguments)
        times.append((time.perf_counter() - begin) * 1e3)
        return result

    return call


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


def calmest(folder: Path, count: int, frames: int, tries: int = 3) -> tuple[float, dict[str, np.ndarray]]:
    """`matrix_rate` and `measured_updates` of the try in which updates took least, compared with products."""
    found = [(matrix_rate(), measured_updates(folder, count, frames)) for _ in range(tries)]
    return min(found, key=lambda one: float(np.median(one[1]["update"])) * one[0])


def rows_of(folder: Path) -> list[dict[str, Any]]:
    """A row for each crowd."""
    work = paper_work()
    network, step = step_of(read_origin(folder)["network"])
    own = multiply_adds(network, step)
    rows = []
    for people in CROWDS:
        rate, times = calmest(folder, people, 410 if people <= 20 else 60)
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


@user_errors()
def main() -> None:
    """Measure, print, and keep the figures when asked to."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.online", description=__doc__)
    parser.add_argument("--model", type=Path, default=Path("models/online/default"))
    parser.add_argument("--json", type=output, help="write the figures there")
    parser.add_argument("--hour", action="store_true", help="also the memory during an hour (a minute)")
    parser.add_argument(
        "--busy", type=count, metavar="N", help="only beside so many busy processes, and alone"
    )
    parser.add_argument("--replay", action="store_true", help="online beside offline forecasts, no times")
    options = parser.parse_args()
    needed(options.model, "dvc repro export")
    if options.busy:
        beside = [
            {"pedestrians": count}
            | slowdown(partial(update_times_ms, options.model, count, 110), options.busy)
            for count in FEW
        ]
        tell("An update alone and beside busy processes, one thread", beside)
        keep({"beside": beside}, options.json)
        return
    if options.replay:
        differing = list(differences(options.model))
        if not differing:
            sys.exit(f"the pipeline forecasts nothing with {options.model}; try models/online/simulation")
        tell("Online and offline forecasts of the same windows, largest distance at any step", differing)
        keep({"replay": differing}, options.json)
        return
    torch.set_num_threads(1)
    rows = rows_of(options.model)
    tell("An update, one thread; GFLOP/s of matrix products", rows)
    figures: dict[str, Any] = {"updates": rows}
    if options.hour:
        figures["hour"] = list(traffic_rows(options.model))
        tell("An hour of people who come and go", figures["hour"])
    keep(figures, options.json)


if __name__ == "__main__":
    main()
