"""Samples per second of the training loop, beside what the machine's matrix rate allows.

`python -m benchmarks.train [--device cuda] [--json FILE]`. A sample is one step of one lane.
Data are random, sizes are those of params.yaml (`methods.networks`, `training.main`); a step includes the
look-up and the variation of its data. All times of a row are taken in turn, round after round, and the
medians compared, so that a machine that is busy elsewhere slows all alike.

Operations per sample: a product with a weight matrix of n entries takes 2 n, forward, and as much again for
each gradient: of the weights, and of its input unless that is data. So 6 sum(n) - 2 sum(n of the layers
that read data).
`of_rate` is the share of the best large product's rate that a step reaches; `of_products` compares it with
the time that the same products take alone, at the sizes and in the order that the network forces.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from benchmarks.timing import keep, tell
from pedpred.config import plain, read_params
from pedpred.datasets import MotionData
from pedpred.features import FeatureSettings
from pedpred.networks import GridEncoder, RecurrentNetwork, parse_settings
from pedpred.networks.contract import NetworkSettings
from pedpred.training.distributed import DistributedContext, distributed_context
from pedpred.training.loop import train_step
from pedpred.training.recurrent import RecurrentLearner, TrainingSettings
from pedpred.training.variation import looked_up

ROUNDS = 15
LARGE = 2048
TRACKS, TRACK_STEPS = 1000, 60
PAPER_STEPS = 300_000


def random_data(sizes: FeatureSettings, with_grid: bool, rng: np.random.Generator) -> MotionData:
    """A data set of random rows, some futures cut short."""
    rows = TRACKS * TRACK_STEPS
    edges = np.arange(0, rows + 1, TRACK_STEPS)

    def numbers(*shape: int) -> Tensor:
        return torch.from_numpy(rng.random((rows, *shape), np.float32))

    width = GridEncoder(sizes.grid_cells).fc.in_features
    return MotionData(
        velocity=numbers(2),
        angular=numbers(sizes.angular_cells),
        future=numbers(sizes.horizon_steps, 2),
        future_steps=torch.from_numpy(rng.integers(0, sizes.horizon_steps + 1, rows)),
        embedding=numbers(width).to(torch.float16) if with_grid else None,
        sequences=np.stack([edges[:-1], edges[1:]], axis=-1),
        scene=np.zeros(TRACKS, np.int64),
        track=np.arange(TRACKS),
        dt_s=sizes.dt_s,
    )


def operations_per_sample(network: RecurrentNetwork) -> int:
    """Floating-point operations of the matrix products, forward and backward, see above."""
    matrices = {name: p.numel() for name, p in network.named_parameters() if p.dim() == 2}
    from_data = reading_data(network)
    return 6 * sum(matrices.values()) - 2 * sum(n for name, n in matrices.items() if name in from_data)


def reading_data(network: RecurrentNetwork) -> set[str]:
    """Names of the weights whose layers read data, to which no gradient flows."""
    found: set[str] = set()

    def look(name: str) -> Callable[[nn.Module, tuple[Tensor, ...]], None]:
        def hook(layer: nn.Module, inputs: tuple[Tensor, ...]) -> None:
            if not inputs[0].requires_grad and isinstance(layer, nn.Linear):
                found.add(f"{name}.weight")

        return hook

    hooks = [layer.register_forward_pre_hook(look(name)) for name, layer in network.named_modules() if name]
    weight = next(network.parameters())
    network({name: weight.new_zeros(1, 1, width) for name, width in network.widths.items()}, network.start(1))
    for hook in hooks:
        hook.remove()
    return found


def products(network: RecurrentNetwork, lanes: int, length: int, device: torch.device) -> Callable[[], None]:
    """The network's matrix products of one step and no more.

    Per weight matrix [u, n]: Y = X W', dX = dY W, dW = dY' X over all steps at once, but W_hh's forward
    product and its input's gradient one step at a time, because each needs the one before.
    """
    from_data = reading_data(network)
    work: list[tuple[Tensor, Tensor, Tensor, int, bool]] = []
    for name, weight in network.named_parameters():
        if weight.dim() == 2:
            units, width = weight.shape
            x, dy = torch.rand(lanes * length, width), torch.rand(lanes * length, units)
            turns = length if "weight_hh" in name else 1
            inner = name not in from_data
            work.append((x.to(device), dy.to(device), weight.detach().clone(), turns, inner))

    def multiply() -> None:
        for x, dy, weight, turns, inner in work:
            for part in x.chunk(turns):
                part @ weight.t()
            for part in dy.chunk(turns) if inner else ():
                part @ weight
            dy.t() @ x

    return multiply


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


def measured(
    name: str,
    settings: NetworkSettings,
    sizes: FeatureSettings,
    training: TrainingSettings,
    here: DistributedContext,
) -> dict[str, Any]:
    """One row of the table: a network on the machine with the present number of threads."""
    torch.manual_seed(0)
    data = random_data(sizes, "grid" in settings.channels_read, np.random.default_rng(0)).to(here.device)
    network = settings.build(data.widths, data.horizon_steps).to(here.device)
    learner = RecurrentLearner(network, data, data.sequences, data.sequences, training, here)
    batches = learner.batches(0)
    square = torch.rand(LARGE, LARGE, device=here.device)
    alone = products(network, training.lanes, training.sub_sequence, here.device)

    def load() -> tuple:
        batch = next(batches)
        return looked_up(data, batch), data.known(batch.rows), batch

    def step() -> None:
        train_step(learner, next(batches), 0)

    with here.precision():
        works = {"rate": lambda: square @ square, "products": alone}
        took = in_turn(works | {"step": step, "load": load, "update": learner.optimizer.step}, here.device)
    samples = training.lanes * training.sub_sequence
    needed = samples * operations_per_sample(network)
    rate = 2 * LARGE**3 / took["rate"]
    middle = {k: float(np.median(v)) * 1e3 for k, v in took.items()}
    return {
        "model": name,
        "products": "bfloat16" if here.autocast else "float32",
        "threads": torch.get_num_threads(),
        "MFLOP/sample": operations_per_sample(network) / 1e6,
        "best_GFLOP/s": float(np.median(rate)) / 1e9,
        "step_ms": middle["step"],
        "samples/s": samples / middle["step"] * 1e3,
        "of_rate": float(np.median(needed / took["step"] / rate)),
        "of_products": float(np.median(took["products"] / took["step"])),
        "products_ms": middle["products"],
        "load_ms": middle["load"],
        "update_ms": middle["update"],
        f"{PAPER_STEPS}_steps_min": PAPER_STEPS * middle["step"] / 6e4,
    }


def main() -> None:
    """Measure, print, and keep the figures when asked to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, help="write the figures there")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu")
    options = parser.parse_args()
    cfg = read_params(Path())
    phase = {k: v for k, v in plain(cfg.training.main).items() if not k.startswith("validation")}
    training = TrainingSettings.parse(phase)
    features = plain(cfg.features)
    features.pop("standstill_mps")
    sizes = FeatureSettings(**plain(cfg.protocol), **features)
    networks = {name: parse_settings(row["settings"]) for name, row in plain(cfg.methods.networks).items()}
    rows = []
    for narrow in (False, True):
        with distributed_context(options.device, narrow) as here:
            for threads in (1, 2) if options.device == "cpu" else (1,):
                torch.set_num_threads(threads)
                rows += [measured(name, own, sizes, training, here) for name, own in networks.items()]
    tell("Training step", rows)
    keep({"train": rows}, options.json)


if __name__ == "__main__":
    main()
