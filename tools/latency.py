"""Time of an update of the online predictor, beside the bound of the paper's network."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn
from torch.utils.flop_counter import FlopCounterMode

from pedpred.config import plain, read_params
from pedpred.features import ForecastProtocol
from pedpred.models.lstm.autoencoder import GridEncoder
from pedpred.models.lstm.features import LstmFeatures
from pedpred.models.mixture.features import MixtureFeatures
from pedpred.models.registry import parse_settings
from pedpred.online import OnlinePredictor
from pedpred.scenes import OccupancyMap

ALLOWED = {20: 1.5, 200: 1.05}
"""Number of people -> largest ratio of an update's time to the bound."""
_SIZES = LstmFeatures()
_SIDE = 1024


def matrix_rate() -> float:
    """Multiply-adds a second of a single-precision matrix product on one thread."""
    a = np.random.default_rng(0).random((_SIDE, _SIDE), dtype=np.float32)
    times: list[float] = []
    while len(times) < 6 or sum(times) < 1.0:
        begin = time.perf_counter()
        a @ a
        times.append(time.perf_counter() - begin)
    return _SIDE**3 / float(np.median(times[1:]))


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


def room(rng: np.random.Generator) -> OccupancyMap:
    """A room of 20 m x 20 m with forty blocks."""
    occupied = np.zeros((200, 200), dtype=bool)
    for x, y in rng.integers(0, 190, (40, 2)):
        occupied[x : x + 10, y : y + 10] = True
    return OccupancyMap(occupied, np.zeros(2), 0.1)


def update_times(folder: Path, count: int, frames: int) -> dict[str, np.ndarray]:
    """Measure updates of a crowd that walks through a room, but for the first ten, ms. [frames - 10] each.

    Returns:
        Wall time of the "update" and of its parts "features", "network" and "choice"; "cpu", its CPU time.
    """
    rng = np.random.default_rng(0)
    robot = OnlinePredictor.load(folder)
    robot.set_map(room(rng))
    times: dict[str, list[float]] = {}
    owners = {
        "features": (robot._steps, "inputs"),
        "network": (robot.network, "step"),
        "choice": (robot, "_forecast"),
    }
    for name, (owner, method) in owners.items():
        setattr(owner, method, _timed(getattr(owner, method), times.setdefault(name, [])))
    update = _timed(robot.update, times.setdefault("cpu", []), time.process_time)
    update = _timed(update, times.setdefault("update", []))
    start, velocity = rng.uniform(0.0, 20.0, (count, 2)), rng.normal(0.0, 1.0, (count, 2))
    for k in range(frames):
        update(0.3 * k, np.arange(count), (start + velocity * 0.3 * k) % 20.0)
    return {name: np.array(own[10:]) for name, own in times.items()}


def _timed(
    function: Callable[..., Any], times: list[float], clock: Callable[[], float] = time.perf_counter
) -> Callable[..., Any]:
    """Wrap a function so that it appends how long each call takes, ms."""

    def call(*arguments: Any) -> Any:
        begin = clock()
        result = function(*arguments)
        times.append((clock() - begin) * 1e3)
        return result

    return call


def best_updates(
    folder: Path, count: int, frames: int, tries: int = 3
) -> tuple[float, dict[str, np.ndarray]]:
    """`matrix_rate` and `measured_updates` of the try in which updates took least, compared with products."""
    found = [(matrix_rate(), update_times(folder, count, frames)) for _ in range(tries)]
    return min(found, key=lambda one: float(np.median(one[1]["update"])) * one[0])
