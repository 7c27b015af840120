"""Training of networks without memory on single situations, drawn from several sets by their shares."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from torch.nn.utils import clip_grad_norm_
from torch.optim.swa_utils import AveragedModel

from pedpred.datasets.situations import SituationData, held_out, load_situations
from pedpred.errors import StorageError, ValueRuleError
from pedpred.networks.contract import Loss, NetworkSettings, RecurrentNetwork
from pedpred.networks.registry import describe_network, is_network
from pedpred.simulation.fields import check_ranges, parsed
from pedpred.storage.checkpoints import load_weights, read_checkpoint
from pedpred.training.distributed import ALONE, DistributedContext
from pedpred.training.loop import Learner, scratch_folder, train
from pedpred.training.omission import Omission, without
from pedpred.training.schedule import Schedule

_ROWS_AT_ONCE = 4096
_BETAS = (0.9, 0.98)


@dataclass(frozen=True, kw_only=True)
class SituationSettings(Schedule):
    """How a network without memory is trained.

    Attributes:
        rows: per step, by all processes together.
        shares: set -> its share of the rows; they need not sum to 1.
        validation_share: of the worlds of each set.
        clip_norm: largest gradient norm.
        weight_decay: decoupled weight decay.
        omission: see there.
        runs: trainings from the same weights, each with the next seed; the network gets the mean of their
            weights, which depends less on the seed (Wortsman et al. 2022).
    """

    rows: int
    shares: Mapping[str, float]
    validation_share: float
    clip_norm: float
    weight_decay: float
    omission: Omission = field(default_factory=Omission, metadata={"parse": partial(parsed, Omission)})
    runs: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        check_ranges(self, {"rows": "[1, 1000000]", "validation_share": "[0, 1)", "runs": "[1, 1000]"})
        check_ranges(self, {"clip_norm": "(0, 1e6]", "weight_decay": "[0, 1]", "shares": "[0, 1e6]"})
        if not sum(self.shares.values()) > 0:
            raise ValueRuleError("shares", dict(self.shares), "one of them must be positive")


@dataclass(frozen=True, kw_only=True)
class RealShare:
    """How much of the rows of an adaptation is real.

    Attributes:
        real_share: share of the rows that real sets divide equally.
    """

    real_share: float = 0.0

    def __post_init__(self) -> None:
        check_ranges(self, {"real_share": "[0, 1]"})


def mixed(simulated: Mapping[str, float], real: Sequence[str], real_share: float) -> dict[str, float]:
    """Shares of simulated and real sets.

    Args:
        simulated: set -> its share of the simulated rows.
        real: sets that share `real_share` of all rows equally; if there is none, all rows are simulated.
        real_share: 0 to 1.
    """
    part = real_share if real else 0.0
    whole = sum(simulated.values())
    return {k: (1 - part) * v / whole for k, v in simulated.items()} | {k: part / len(real) for k in real}


class SituationLearner(Learner):
    """A network without memory and its rows; the last weights are kept."""

    network: RecurrentNetwork
    settings: SituationSettings

    def __init__(
        self,
        network: RecurrentNetwork,
        data: SituationData,
        settings: SituationSettings,
        context: DistributedContext = ALONE,
    ):
        """Divide the worlds of each set.

        Args:
            network: initialised, on the context's device.
            data: the sets that `settings.shares` names, on the same device.
            settings: see there.
            context: of this process.
        """
        self.network, self.data, self.settings, self.context = network, data, settings, context
        self.memory = {}
        self.optimizer = torch.optim.AdamW(
            network.parameters(), settings.lr, _BETAS, weight_decay=settings.weight_decay, fused=True
        )
        rng = np.random.default_rng(settings.seed)
        kept = {name: held_out(spans, settings.validation_share, rng) for name, spans in data.worlds.items()}
        self.training = {name: _rows(data.worlds[name][~kept[name]]) for name in kept}
        self.validation = np.concatenate([_rows(data.worlds[name][kept[name]]) for name in kept])

    def batches(self, done: int) -> Iterator[np.ndarray]:
        """Rows of the data, [B] each; those of a step depend on its number alone."""
        how, own = self.settings, self.context.share(self.settings.rows)
        sets = [(rows, how.shares.get(name, 0.0)) for name, rows in self.training.items() if len(rows)]
        share = np.array([share for _, share in sets]) / sum(share for _, share in sets)
        step = done
        while True:
            rng = np.random.default_rng([how.seed, step])
            each = rng.multinomial(how.rows, share)
            drawn = [rows[rng.integers(len(rows), size=n)] for (rows, _), n in zip(sets, each, strict=True)]
            yield rng.permutation(np.concatenate(drawn))[own]
            step += 1

    def loss(self, batch: np.ndarray, step: int) -> Loss:
        """Of one batch of rows."""
        rng = np.random.default_rng([self.settings.seed, step, self.context.rank])
        rows = torch.from_numpy(batch).to(self.data.future.device)
        inputs = without(self.data.inputs(rows), self.settings.omission, self.data.sizes.beam_range_m, rng)
        future = self.data.future[rows]
        with self.context.precision():
            outputs, _ = self.network(inputs, {})
        known = torch.ones(future.shape[:-1], dtype=torch.bool, device=future.device)
        return self.network.loss(outputs, future, known, self.data.sizes.dt_s)

    def clip(self) -> None:
        """Clip all weights by one norm."""
        clip_grad_norm_(self.network.parameters(), self.settings.clip_norm)

    @torch.inference_mode()
    def validate(self) -> dict[str, float]:
        """Mean scores over the worlds kept for it; nan where there is none.

        Returns:
            "validation_<score>" for each of the network's scores.
        """
        names = self.network.score_names
        sums = torch.zeros(len(names), dtype=torch.float64)
        for at in range(0, len(self.validation), _ROWS_AT_ONCE):
            rows = torch.from_numpy(self.validation[at : at + _ROWS_AT_ONCE]).to(self.data.future.device)
            with self.context.precision():
                outputs, _ = self.network(self.data.inputs(rows), {})
            scores = self.network.scores(outputs, self.data.future[rows], self.data.sizes.dt_s)
            sums += torch.stack([scores[name].double().mean(dim=-1).sum() for name in names]).cpu()
        count = len(self.validation) or float("nan")
        return {f"validation_{n}": total / count for n, total in zip(names, sums.tolist(), strict=True)}


def _rows(spans: np.ndarray) -> np.ndarray:
    """All rows of some spans [first, last). [S, 2] -> [M] int64."""
    return np.concatenate([np.zeros(0, np.int64), *(np.arange(*span) for span in spans)])


def fit_situations(
    network_settings: NetworkSettings,
    previous: Path | None,
    folders: Mapping[str, Path],
    settings: SituationSettings,
    description: str,
    context: DistributedContext,
) -> tuple[RecurrentNetwork, pd.DataFrame, dict]:
    """Load the sets and train.

    Args:
        network_settings: of the network.
        previous: checkpoint of the same network to start from; None starts with random weights.
        folders: set -> folder of its situations.
        settings: see there.
        description: title of the progress bar.
        context: where to train.

    Returns:
        The network, the mean curve of the runs, and the checkpoint's description.

    Raises:
        StorageError: a set or the checkpoint is missing, damaged or does not fit.
        ValueRuleError: several runs have no weights to start from.
    """
    runs = settings.runs
    if runs > 1 and previous is None:
        raise ValueRuleError("runs", runs, "the mean of several needs weights to start from; use 1")
    data = load_situations(folders)
    about: dict[str, Any] = {
        "dt_s": data.sizes.dt_s,
        "training": asdict(settings),
        "future_sha256": hashlib.sha256(data.future.numpy().tobytes()).hexdigest(),
    }
    data = data.to(context.device)
    networks, curves = [], []
    for seed in range(settings.seed, settings.seed + runs):
        torch.manual_seed(seed)
        network = _start(network_settings, previous, data)
        about = describe_network(network) | about
        own, title = replace(settings, seed=seed), description + (f", seed {seed}" if runs > 1 else "")
        with scratch_folder(about | {"seed": seed}, network.state_dict(), context) as scratch:
            learner = SituationLearner(network.to(context.device), data, own, context)
            curves.append(pd.DataFrame(train(learner, scratch, title)))
        networks.append(network)
    curve = pd.concat(curves).groupby(level=0).mean().astype(curves[0].dtypes)
    return mean_of(networks), curve, about


def _start(network_settings: NetworkSettings, previous: Path | None, data: SituationData) -> RecurrentNetwork:
    """A network with random weights, or with those of a checkpoint."""
    widths = {name: values.shape[1] for name, values in data.channels.items()}
    network = network_settings.build(widths, data.sizes.horizon_steps)
    if previous is not None:
        weights, about = read_checkpoint(previous)
        if not is_network(about):
            raise StorageError(previous, "kind", f"it is {about['kind']!r}, not a network", "Train it again")
        load_weights(network, weights, previous)
    return network


def mean_of(networks: Sequence[RecurrentNetwork]) -> RecurrentNetwork:
    """A network with the mean of the weights of some."""
    mean = AveragedModel(networks[0])
    for network in networks:
        mean.update_parameters(network)
    assert isinstance(mean.module, RecurrentNetwork)
    return mean.module
