"""The training of a forecasting network: a sampler gives batches, the recurrent state is carried on."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple, Protocol

import torch
from torch import Tensor
from torch.nn.utils import clip_grad_norm_

from pedpred.datasets.rows import TrainingRows
from pedpred.models.contract import ForecastNetwork, Loss, Tensors, detach, reset, select
from pedpred.settings import In
from pedpred.training.distributed import ALONE, DistributedContext
from pedpred.training.loop import Learner
from pedpred.training.schedule import Schedule

_SEED_DISTANCE = 1_000_003
"""Between the seeds of two processes, so that they do not drop the same units."""


class Examples(NamedTuple):
    """What a network reads and learns from one batch.

    Attributes:
        inputs: channel -> [B, L, width], or [B, width] of single instants.
        future: true velocities, agent frame, m/s. [..., P, 2]
        known: which of them count. [..., P] bool
        starts: tracks that start, whose state is reset first. [B] bool
    """

    inputs: dict[str, Tensor]
    future: Tensor
    known: Tensor
    starts: Tensor


class Sampler(Protocol):
    """Divides rows into those to learn from and those to validate by, and draws batches of the former.

    Attributes:
        lanes: rows of a batch of this process, B: lanes of tracks, or single instants.
    """

    @property
    def lanes(self) -> int:
        """See above."""

    def batches(self, done: int) -> Iterator[Any]:
        """This process's part of an endless stream of batches, without those of the steps that are done."""

    def examples(self, batch: Any, step: int) -> Examples:
        """Look up the rows of a batch, altered as in no other step."""

    def outputs(self, network: ForecastNetwork) -> Iterator[tuple[Tensor, Tensors]]:
        """This process's part of the validation rows, and the network's outputs there. [m], [m, ...] each."""


@dataclass(frozen=True, kw_only=True)
class FitSettings(Schedule, ABC):
    """What the trainings of all networks have in common; each kind draws its own batches.

    Attributes:
        betas: of the moments of AdamW.
        keeps_best: the best validated weights are kept; otherwise the last ones.
        clip_norm: largest gradient norm.
        weight_decay: decoupled weight decay (the paper's lambda).
        runs: trainings from the same weights, each with the next seed; the network gets the mean of their
            weights, which depends less on the seed (Wortsman et al. 2022).
    """

    betas: ClassVar[tuple[float, float]]
    keeps_best: ClassVar[bool]

    clip_norm: Annotated[float, In("(0, 1e6]")]
    weight_decay: Annotated[float, In("[0, 1]")]
    runs: Annotated[int, In("[1, 1000]")] = 1

    @abstractmethod
    def sampler(self, data: TrainingRows, context: DistributedContext) -> Sampler:
        """Divide rows and draw batches of them, for one process of a training."""

    def learner(
        self, network: ForecastNetwork, data: TrainingRows, context: DistributedContext = ALONE
    ) -> Learner:
        """What trains a network on some rows; arguments of `NetworkLearner`."""
        return NetworkLearner(network, data, self.sampler(data, context), self, context)


class NetworkLearner(Learner):
    """A forecasting network, its rows and the recurrent state of a batch's tracks, if it has one."""

    network: ForecastNetwork
    settings: FitSettings

    def __init__(
        self,
        network: ForecastNetwork,
        data: TrainingRows,
        sampler: Sampler,
        settings: FitSettings,
        context: DistributedContext = ALONE,
    ):
        """Begin before the first step.

        Args:
            network: initialised, on the context's device; the starting weights count as the first candidate.
            data: all rows, on the same device.
            sampler: of these rows.
            settings: see `FitSettings`.
            context: of this process.
        """
        self.network, self.data, self.sampler = network, data, sampler
        self.settings, self.context = settings, context
        self.optimizer = torch.optim.AdamW(
            network.parameters(), settings.lr, settings.betas, weight_decay=settings.weight_decay, fused=True
        )
        self.memory = network.start(sampler.lanes)
        self.best_by = f"validation_{network.score_names[0]}" if settings.keeps_best else None

    def batches(self, done: int) -> Iterator[Any]:
        """Those of the sampler."""
        return self.sampler.batches(done)

    def loss(self, batch: Any, step: int) -> Loss:
        """The network's loss on a batch; the state is carried on, the gradient is not."""
        # Dropout is the same when the training is resumed.
        torch.manual_seed(self.settings.seed + step + _SEED_DISTANCE * self.context.rank)
        inputs, future, known, starts = self.sampler.examples(batch, step)
        state = detach(reset(self.memory, starts))
        with self.context.precision():
            outputs, self.memory = self.network(inputs, state)
        return self.network.loss(outputs, future, known, self.data.dt_s)

    def clip(self) -> None:
        """Clip each group of weights by its own norm."""
        for weights in self.network.clipped_groups():
            clip_grad_norm_(weights, self.settings.clip_norm)

    def validate(self) -> dict[str, float]:
        """Mean scores over all validation rows whose whole horizon is known; nan where there is none.

        Returns:
            "validation_<score>" for each of the network's scores.
        """
        names = [f"validation_{name}" for name in self.network.score_names]
        data = self.data
        sums = torch.zeros(len(names) + 1, dtype=torch.float64, device=data.future.device)  # and how many
        for rows, outputs in self.sampler.outputs(self.network):
            known = data.known(rows).all(dim=-1)
            truth = data.future[rows[known]]
            scores = list(self.network.scores(select(outputs, known), truth, data.dt_s).values())
            counted = sums.new_tensor(scores[0].numel())
            sums += torch.stack([*(score.double().sum() for score in scores), counted])
        *totals, count = self.context.total(sums).tolist()
        return {n: total / count if count else float("nan") for n, total in zip(names, totals, strict=True)}
