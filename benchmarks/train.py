"""Samples per second of the training loop, beside what the machine's matrix rate allows.

`python -m benchmarks.train [--device cuda] [--json FILE]`. A sample is one step of one lane, or one situation
of a network without memory. Data are random, sizes are those of params.yaml (`methods`, `training`); a step
includes the look-up and the augmentation of its data. All times of a row are taken in turn, round after
round, and the medians compared, so that a machine that is busy elsewhere slows all alike.

`of_rate` is the share of the best large product's rate that a step reaches. Operations of a network without
memory are counted while it computes. A recurrent network takes 2 n for the product with a weight matrix of n
entries, and as much again for the gradients of its weights and of its input, so 6 n in all.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.utils.flop_counter import FlopCounterMode

from benchmarks.tables import keep, show
from pedpred.config import plain, read_params
from pedpred.datasets import TrainingRows
from pedpred.datasets.rows import Spans
from pedpred.errors import user_errors
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Following
from pedpred.models import ARCHITECTURES
from pedpred.models.contract import NetworkSettings
from pedpred.models.features import RowFormat, parse_features
from pedpred.models.lstm.autoencoder import GridEncoder
from pedpred.models.lstm.features import LstmFeatures
from pedpred.models.registry import parse_settings
from pedpred.settings import load, load_together
from pedpred.training.distributed import DistributedContext, distributed_context, multiplies_bfloat16
from pedpred.training.instants import InstantSettings
from pedpred.training.learner import NetworkLearner
from pedpred.training.loop import Learner, train_step
from pedpred.training.sequences import SequenceSampler, SequenceSettings
from pedpred.training.sets import NamedSets
from tools.arguments import output

TRACKS, TRACK_STEPS = 1000, 60
SITUATIONS = 50_000

ROUNDS = 15
LARGE = 2048


@dataclass(frozen=True)
class Case:
    """A training.

    Attributes:
        learner: on its device.
        samples: of one step.
        operations: floating-point operations of the matrix products of one sample, forward and backward.
        load: looks up the data of a batch.
    """

    learner: Learner
    samples: int
    operations: float
    load: Callable[[Any], object]


def cases() -> dict[str, Callable[[DistributedContext], Case]]:
    """Name of each network of params.yaml -> its training."""
    cfg = read_params(Path())
    protocol, _ = load_together([ForecastProtocol, Following], plain(cfg.protocol))
    lstm, mixture = (
        RowFormat(protocol, kind, parse_features(kind, plain(cfg.features[kind])))
        for kind in ("lstm", "mixture")
    )
    recurrent = load_together([SequenceSettings, NamedSets], plain(cfg.training.main))[0]
    alone = plain(cfg.training.situations) | {"shares": {"random": 1.0}, "validation_share": 0.0}
    situations = load(InstantSettings, alone)

    made: dict[str, Callable[[DistributedContext], Case]] = {}
    for name, row in plain(cfg.methods.networks).items():
        settings = parse_settings(row["settings"])
        if ARCHITECTURES[row["settings"]["architecture"]].features == "lstm":
            made[name] = partial(recurrent_case, settings, lstm, recurrent)
        else:
            made[name] = partial(situation_case, settings, mixture, situations)
    return made


def recurrent_case(
    settings: NetworkSettings, made_with: RowFormat, training: SequenceSettings, here: DistributedContext
) -> Case:
    """The training of a recurrent network; a sample is one step of one lane."""
    torch.manual_seed(0)
    data = random_data(made_with, "grid" in settings.channels_read, np.random.default_rng(0)).to(here.device)
    network = settings.build(data.widths, data.horizon_steps).to(here.device)
    spans = data.spans.rows
    sampler = SequenceSampler(data, spans, spans, training, here)
    learner = NetworkLearner(network, data, sampler, training, here)
    samples = training.lanes * training.sub_sequence
    weights = sum(p.numel() for p in network.parameters() if p.dim() == 2)
    return Case(learner, samples, 6 * weights, partial(sampler.examples, step=0))


def situation_case(
    settings: NetworkSettings, made_with: RowFormat, training: InstantSettings, here: DistributedContext
) -> Case:
    """The training of a network without memory; a sample is one situation."""
    torch.manual_seed(0)
    shapes, steps = made_with.features.shapes(), made_with.protocol.horizon_steps
    channels = {name: torch.rand(SITUATIONS, *shape).half() for name, shape in shapes.items()}
    future, known = torch.rand(SITUATIONS, steps, 2), torch.full((SITUATIONS,), steps)
    one = np.zeros(1, int)
    spans = Spans(np.array([[0, SITUATIONS]]), one, one, one)
    data = TrainingRows(channels, future, known, spans, ("random",), made_with).to(here.device)
    network = settings.build(data.widths, steps).to(here.device)
    sampler = training.sampler(data, here)
    learner = NetworkLearner(network, data, sampler, training, here)
    with FlopCounterMode(display=False) as counted:
        learner.loss(np.arange(training.rows), 0).total.backward()
    operations = counted.get_total_flops() / training.rows

    return Case(learner, training.rows, operations, partial(sampler.examples, step=0))


def random_data(made_with: RowFormat, with_grid: bool, rng: np.random.Generator) -> TrainingRows:
    """A data set of random rows, some futures cut short."""
    rows = TRACKS * TRACK_STEPS
    edges = np.arange(0, rows + 1, TRACK_STEPS)

    def numbers(*shape: int) -> Tensor:
        return torch.from_numpy(rng.random((rows, *shape), np.float32))

    sizes, steps = made_with.features, made_with.protocol.horizon_steps
    assert isinstance(sizes, LstmFeatures)
    channels = {"state": numbers(2), "angular": numbers(sizes.angular_cells)}
    if with_grid:
        channels["grid"] = numbers(GridEncoder(sizes.grid_cells).fc.in_features).to(torch.float16)
    spans = Spans(
        np.stack([edges[:-1], edges[1:]], axis=-1),
        *(np.zeros(TRACKS, int) for _ in range(2)),
        np.arange(TRACKS),
    )
    known = torch.from_numpy(rng.integers(0, steps + 1, rows))
    return TrainingRows(channels, numbers(steps, 2), known, spans, ("random",), made_with)


def times_in_turn(works: dict[str, Callable[[], Any]], device: torch.device) -> dict[str, np.ndarray]:
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


def measure_case(name: str, case: Case, here: DistributedContext) -> dict[str, Any]:
    """One row of the table: a network on the machine with the present number of threads."""
    batches = case.learner.batches(0)
    square = torch.rand(LARGE, LARGE, device=here.device)
    works: dict[str, Callable[[], Any]] = {
        "rate": lambda: square @ square,
        "step": lambda: train_step(case.learner, next(batches), 0),
        "load": lambda: case.load(next(batches)),
        "update": case.learner.optimizer.step,
    }
    with here.precision():
        took = times_in_turn(works, here.device)
    rate = 2 * LARGE**3 / took["rate"]
    middle = {k: float(np.median(v)) * 1e3 for k, v in took.items()}
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
        "load_ms": middle["load"],
        "update_ms": middle["update"],
    }


@user_errors()
def main() -> None:
    """Measure, print, and keep the figures when asked to."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.train", description=__doc__)
    parser.add_argument("--json", type=output, help="write the figures there")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu")
    options = parser.parse_args()
    rows = []
    for narrow in (False, True):
        with distributed_context(options.device, narrow) as here:
            if narrow and not multiplies_bfloat16(here.device):
                print(f"bfloat16 is left out: this {options.device} has no units for it")
                continue
            for threads in (1, 2) if options.device == "cpu" else (1,):
                torch.set_num_threads(threads)
                rows += [measure_case(name, make(here), here) for name, make in cases().items()]
    show("Training step", rows)
    keep({"train": rows}, options.json)


if __name__ == "__main__":
    main()
