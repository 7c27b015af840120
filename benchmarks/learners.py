"""Learners on random data, at the sizes of params.yaml, and how much work a step of theirs is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.utils.flop_counter import FlopCounterMode

from pedpred.config import plain, read_params
from pedpred.datasets import MotionData
from pedpred.datasets.lanes import SplitSettings
from pedpred.datasets.situations import SituationData
from pedpred.features import FeatureSettings
from pedpred.features.situation import channel_widths
from pedpred.networks import GridEncoder, RecurrentNetwork, parse_settings
from pedpred.networks.contract import NetworkSettings
from pedpred.simulation.fields import parsed, parsed_together
from pedpred.training.distributed import DistributedContext
from pedpred.training.loop import Learner
from pedpred.training.recurrent import RecurrentLearner, TrainingSettings
from pedpred.training.situations import SituationLearner, SituationSettings
from pedpred.training.variation import looked_up

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
    features = plain(cfg.features)
    features.pop("standstill_mps")
    sizes = FeatureSettings(**plain(cfg.protocol), **features)
    _, recurrent = parsed_together([SplitSettings, TrainingSettings], plain(cfg.training.main))
    alone = plain(cfg.training.situations) | {"shares": {"random": 1.0}, "validation_share": 0.0}
    situations = parsed(SituationSettings, alone)

    def rolling(own: NetworkSettings) -> Callable[[DistributedContext], Case]:
        return lambda here: recurrent_case(own, sizes, recurrent, here)

    def memoryless(own: NetworkSettings) -> Callable[[DistributedContext], Case]:
        return lambda here: situation_case(own, sizes, situations, here)

    rows = plain(cfg.methods.networks), plain(cfg.methods.memoryless)
    first, second = ({name: parse_settings(row["settings"]) for name, row in own.items()} for own in rows)
    return {k: rolling(v) for k, v in first.items()} | {k: memoryless(v) for k, v in second.items()}


def recurrent_case(
    settings: NetworkSettings, sizes: FeatureSettings, training: TrainingSettings, here: DistributedContext
) -> Case:
    """The training of a recurrent network; a sample is one step of one lane."""
    torch.manual_seed(0)
    data = random_data(sizes, "grid" in settings.channels_read, np.random.default_rng(0)).to(here.device)
    network = settings.build(data.widths, data.horizon_steps).to(here.device)
    learner = RecurrentLearner(network, data, data.sequences, data.sequences, training, here)
    alone = products(network, training.lanes, training.sub_sequence, here.device)

    def load(batch: Any) -> object:
        return looked_up(data, batch), data.known(batch.rows)

    samples = training.lanes * training.sub_sequence
    return Case(learner, samples, operations_per_sample(network), load, alone)


def situation_case(
    settings: NetworkSettings, sizes: FeatureSettings, training: SituationSettings, here: DistributedContext
) -> Case:
    """The training of a network without memory; a sample is one situation."""
    torch.manual_seed(0)
    widths = channel_widths(sizes)
    channels = {name: torch.rand(SITUATIONS, width).half() for name, width in widths.items()}
    future = torch.rand(SITUATIONS, sizes.horizon_steps, 2)
    data = SituationData(channels, future, {"random": np.array([[0, SITUATIONS]])}, sizes).to(here.device)
    network = settings.build(widths, sizes.horizon_steps).to(here.device)
    learner = SituationLearner(network, data, training, here)
    with FlopCounterMode(display=False) as counted:
        learner.loss(np.arange(training.rows), 0).total.backward()
    operations = counted.get_total_flops() / training.rows

    def load(batch: np.ndarray) -> object:
        rows = torch.from_numpy(batch).to(here.device)
        return data.inputs(rows), data.future[rows]

    return Case(learner, training.rows, operations, load, None)


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
