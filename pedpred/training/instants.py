"""Training of networks without memory on single instants, drawn from several sets by their shares."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
from torch.nn.utils import clip_grad_norm_

from pedpred.datasets.rows import TrainingRows, load_instants, select_held_out
from pedpred.errors import ValueRuleError
from pedpred.models.contract import ForecastNetwork, Loss
from pedpred.models.mixture.features import MixtureFeatures
from pedpred.models.mixture.masking import InputMasking, mask
from pedpred.settings import In, Settings
from pedpred.training.distributed import ALONE, DistributedContext
from pedpred.training.loop import Learner
from pedpred.training.schedule import FitSettings

_ROWS_AT_ONCE = 4096
_BETAS = (0.9, 0.98)


@dataclass(frozen=True, kw_only=True)
class InstantSettings(FitSettings):
    """How a network without memory is trained, on single instants.

    Attributes:
        rows: per step, by all processes together.
        shares: set -> its share of the rows; they need not sum to 1.
        validation_share: of the worlds of each set.
        masking: see there.
    """

    rows: Annotated[int, In("[1, 1000000]")]
    shares: Mapping[str, Annotated[float, In("[0, 1e6]")]]
    validation_share: Annotated[float, In("[0, 1)")]
    masking: InputMasking = field(default_factory=InputMasking)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not sum(self.shares.values()) > 0:
            raise ValueRuleError("shares", dict(self.shares), "one of them must be positive")

    def load(self, folders: Mapping[str, Path], embeddings: Mapping[str, Path] | None) -> TrainingRows:
        """All instants of some sets; see `load_instants`."""
        return load_instants(folders)

    def learner(
        self, network: ForecastNetwork, rows: TrainingRows, context: DistributedContext
    ) -> InstantLearner:
        """Divide the worlds of each set."""
        return InstantLearner(network, rows, self, context)


@dataclass(frozen=True, kw_only=True)
class RealShare(Settings):
    """How much of the rows of an adaptation is real.

    Attributes:
        real_share: share of the rows that real sets divide equally.
    """

    real_share: Annotated[float, In("[0, 1]")] = 0.0


def mix_shares(simulated: Mapping[str, float], real: Sequence[str], real_share: float) -> dict[str, float]:
    """Shares of simulated and real sets.

    Args:
        simulated: set -> its share of the simulated rows.
        real: sets that share `real_share` of all rows equally; if there is none, all rows are simulated.
        real_share: 0 to 1.
    """
    part = real_share if real else 0.0
    whole = sum(simulated.values())
    return {k: (1 - part) * v / whole for k, v in simulated.items()} | {k: part / len(real) for k in real}


class InstantLearner(Learner):
    """A network without memory and its rows; the last weights are kept."""

    network: ForecastNetwork
    settings: InstantSettings

    def __init__(
        self,
        network: ForecastNetwork,
        data: TrainingRows,
        settings: InstantSettings,
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
        features = data.made_with.features
        assert isinstance(features, MixtureFeatures)
        self.free_m, self.memory = features.beam_range_m, {}
        self.optimizer = torch.optim.AdamW(
            network.parameters(), settings.lr, _BETAS, weight_decay=settings.weight_decay, fused=True
        )
        rng = np.random.default_rng(settings.seed)
        worlds, share = data.by_set, settings.validation_share
        kept = {name: select_held_out(spans, share, rng) for name, spans in worlds.items()}
        self.training = {name: _rows(worlds[name][~kept[name]]) for name in kept}
        self.validation = np.concatenate([_rows(worlds[name][kept[name]]) for name in kept])

    def batches(self, done: int) -> Iterator[np.ndarray]:
        """Rows of the data, [B] each; those of a step depend on its number alone."""
        how, of_rank = self.settings, self.context.share(self.settings.rows)
        sets = [(rows, how.shares.get(name, 0.0)) for name, rows in self.training.items() if len(rows)]
        share = np.array([share for _, share in sets]) / sum(share for _, share in sets)
        step = done
        while True:
            rng = np.random.default_rng([how.seed, step])
            each = rng.multinomial(how.rows, share)
            drawn = [rows[rng.integers(len(rows), size=n)] for (rows, _), n in zip(sets, each, strict=True)]
            yield rng.permutation(np.concatenate(drawn))[of_rank]
            step += 1

    def loss(self, batch: np.ndarray, step: int) -> Loss:
        """Of one batch of rows."""
        rng = np.random.default_rng([self.settings.seed, step, self.context.rank])
        rows = torch.from_numpy(batch).to(self.data.future.device)
        inputs = mask(self.data.inputs(rows), self.settings.masking, self.free_m, rng)
        future = self.data.future[rows]
        with self.context.precision():
            outputs, _ = self.network(inputs, {})
        known = torch.ones(future.shape[:-1], dtype=torch.bool, device=future.device)
        return self.network.loss(outputs, future, known, self.data.dt_s)

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
            scores = self.network.scores(outputs, self.data.future[rows], self.data.dt_s)
            sums += torch.stack([scores[name].double().mean(dim=-1).sum() for name in names]).cpu()
        count = len(self.validation) or float("nan")
        return {f"validation_{n}": total / count for n, total in zip(names, sums.tolist(), strict=True)}


def _rows(spans: np.ndarray) -> np.ndarray:
    """All rows of some spans [first, last). [S, 2] -> [M] int64."""
    return np.concatenate([np.zeros(0, np.int64), *(np.arange(*span) for span in spans)])
