"""Learners on random data, at the sizes of params.yaml, and how much work a step of theirs is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.utils.flop_counter import FlopCounterMode

from pedpred.config import plain, read_params
from pedpred.datasets import TrainingRows
from pedpred.datasets.rows import Spans
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Following
from pedpred.models.contract import ForecastNetwork, NetworkSettings
from pedpred.models.features import RowFormat, parse_features
from pedpred.models.lstm.augmentation import look_up
from pedpred.models.lstm.autoencoder import GridEncoder
from pedpred.models.lstm.features import LstmFeatures
from pedpred.models.registry import parse_settings
from pedpred.settings import load, load_together
from pedpred.training.distributed import DistributedContext
from pedpred.training.instants import InstantLearner, InstantSettings
from pedpred.training.loop import Learner
from pedpred.training.sequences import NamedSets, SequenceLearner, SequenceSettings

TRACKS, TRACK_STEPS = 1000, 60
SITUATIONS = 50_000


@dataclass(frozen=True)
class Case:
    """A training.

    Attributes:
        learner: on its device.
        samples: of one step.
        operations: floating-point operations of the matrix products of one sample, forward and backward.
        load: looks up the data of a batch.
        products: the matrix products of a step and no more; None where they are not replayed.
    """

    learner: Learner
    samples: int
    operations: float
    load: Callable[[Any], object]
    products: Callable[[], None] | None


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
        made[name] = partial(recurrent_case, parse_settings(row["settings"]), lstm, recurrent)
    for name, row in plain(cfg.methods.memoryless).items():
        made[name] = partial(situation_case, parse_settings(row["settings"]), mixture, situations)
    return made


def recurrent_case(
    settings: NetworkSettings, made_with: RowFormat, training: SequenceSettings, here: DistributedContext
) -> Case:
    """The training of a recurrent network; a sample is one step of one lane."""
    torch.manual_seed(0)
    data = random_data(made_with, "grid" in settings.channels_read, np.random.default_rng(0)).to(here.device)
    network = settings.build(data.widths, data.horizon_steps).to(here.device)
    spans = data.spans.rows
    learner = SequenceLearner(network, data, spans, spans, training, here)
    alone = products(network, training.lanes, training.sub_sequence, here.device)

    def load(batch: Any) -> object:
        return look_up(data, batch), data.known(batch.rows)

    samples = training.lanes * training.sub_sequence
    return Case(learner, samples, operations_per_sample(network), load, alone)


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
    learner = InstantLearner(network, data, training, here)
    with FlopCounterMode(display=False) as counted:
        learner.loss(np.arange(training.rows), 0).total.backward()
    operations = counted.get_total_flops() / training.rows

    def load(batch: np.ndarray) -> object:
        rows = torch.from_numpy(batch).to(here.device)
        return data.inputs(rows), data.future[rows]

    return Case(learner, training.rows, operations, load, None)


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


def operations_per_sample(network: ForecastNetwork) -> int:
    """Floating-point operations of the matrix products, forward and backward, see above."""
    matrices = {name: p.numel() for name, p in network.named_parameters() if p.dim() == 2}
    from_data = reading_data(network)
    return 6 * sum(matrices.values()) - 2 * sum(n for name, n in matrices.items() if name in from_data)


def reading_data(network: ForecastNetwork) -> set[str]:
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


def products(network: ForecastNetwork, lanes: int, length: int, device: torch.device) -> Callable[[], None]:
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
