"""Training of recurrent networks by truncated back-propagation through time: all phases of the curriculum."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from torch.nn.utils import clip_grad_norm_

from pedpred.datasets.lanes import stream_lanes
from pedpred.datasets.motion import MotionData
from pedpred.networks.contract import Loss, RecurrentNetwork, detach, reset, select
from pedpred.networks.forecasting import rolled
from pedpred.training.distributed import ALONE, DistributedContext
from pedpred.training.loop import Learner, Schedule, train
from pedpred.training.variation import Variation, VariedBatch, looked_up, varied

_SEED_DISTANCE = 1_000_003
"""Between the seeds of two processes, so that they do not drop the same units."""


@dataclass(frozen=True, kw_only=True)
class TrainingSettings(Schedule):
    """How a recurrent network is trained.

    Attributes:
        lanes: tracks that are streamed side by side, B; by all processes together.
        sub_sequence: truncation depth L, steps.
        longest_track: tracks are cut into pieces of at most this many steps.
        clip_norm: largest gradient norm.
        weight_decay: decoupled weight decay (the paper's lambda).
        variation: see there.
    """

    lanes: int
    sub_sequence: int
    longest_track: int
    clip_norm: float
    weight_decay: float
    variation: Variation = field(default_factory=Variation)

    @classmethod
    def parse(cls, plain: Mapping) -> TrainingSettings:
        """Build from plain dictionaries (configuration)."""
        return cls(**{**plain, "variation": Variation(**plain["variation"])})


@dataclass(eq=False)
class RecurrentLearner(Learner):
    """A recurrent network, its data and the state of its lanes.

    Attributes:
        network: initialised, on the context's device; the starting weights count as the first candidate.
        data: all rows, on the same device.
        training: rows [first, last) of the sequences to learn from. [S, 2]
        validation: rows [first, last) of the sequences to choose the weights by. [S, 2]
        settings: see there.
        context: of this process.
    """

    network: RecurrentNetwork
    data: MotionData
    training: np.ndarray
    validation: np.ndarray
    settings: TrainingSettings
    context: DistributedContext

    def __post_init__(self) -> None:
        settings = self.settings
        self.optimizer = torch.optim.AdamW(
            self.network.parameters(), lr=settings.lr, weight_decay=settings.weight_decay, fused=True
        )
        self.lanes = self.context.share(settings.lanes)
        self.memory = self.network.start(self.lanes.stop - self.lanes.start)
        self.best_by = f"validation_{self.network.score_names[0]}"

    def batches(self, done: int) -> Iterator[VariedBatch]:
        """This process's part of every batch."""
        batches = training_batches(self.training, self.settings, done)
        return (batch.part(self.lanes, self.context.device) for batch in batches)

    def loss(self, batch: VariedBatch, step: int) -> Loss:
        """One sub-sequence of every lane; the state is carried on, the gradient is not."""
        # Dropout is the same when the training is resumed.
        torch.manual_seed(self.settings.seed + step + _SEED_DISTANCE * self.context.rank)
        inputs, future = looked_up(self.data, batch)
        known = self.data.known(batch.rows)
        state = detach(reset(self.memory, batch.starts))
        with self.context.precision():
            outputs, self.memory = self.network(inputs, state)
        return self.network.loss(outputs, future, known, self.data.dt_s)

    def clip(self) -> None:
        """Clip each group of weights by its own norm."""
        for weights in self.network.clipped_groups():
            clip_grad_norm_(weights, self.settings.clip_norm)

    def validate(self) -> dict[str, float]:
        """See `validation`."""
        return validation(self.network, self.data, self.validation, self.context)


def train_motion(
    network: RecurrentNetwork,
    data: MotionData,
    training: np.ndarray,
    validation: np.ndarray,
    settings: TrainingSettings,
    scratch: Path | None,
    description: str,
    context: DistributedContext = ALONE,
) -> list[dict[str, float]]:
    """Train by truncated back-propagation through time; leaves the best validated weights in `network`.

    Arguments are those of `RecurrentLearner` and of `pedpred.training.loop.train`, which this returns.
    """
    learner = RecurrentLearner(network, data, training, validation, settings, context)
    return train(learner, settings, scratch, description, context)


def training_batches(training: np.ndarray, settings: TrainingSettings, done: int) -> Iterator[VariedBatch]:
    """The endless stream of lanes, without the steps that are done."""
    rng = np.random.default_rng(settings.seed)
    stream = stream_lanes(training, settings.lanes, settings.sub_sequence, settings.longest_track, rng)
    for step, batch in enumerate(islice(stream, done, None), done):
        yield varied(batch, settings.variation, np.random.default_rng([settings.seed, step]))


def validation(
    network: RecurrentNetwork, data: MotionData, sequences: np.ndarray, context: DistributedContext = ALONE
) -> dict[str, float]:
    """Means over all steps whose whole horizon is known; nan where there is none.

    The processes of a training divide the sequences [S, 2] among them.

    Returns:
        "validation_<score>" for each of the network's scores; the first one chooses the weights.
    """
    names = [f"validation_{name}" for name in network.score_names]
    sums = torch.zeros(len(names) + 1, dtype=torch.float64, device=data.future.device)  # and how many
    for rows, outputs in rolled(network, data, sequences[context.rank :: context.size]):
        known = data.known(rows).all(dim=-1)
        scores = list(network.scores(select(outputs, known), data.future[rows[known]], data.dt_s).values())
        counted = sums.new_tensor(scores[0].numel())
        sums += torch.stack([*(score.double().sum() for score in scores), counted])
    *totals, count = context.total(sums).tolist()
    return {name: total / count if count else float("nan") for name, total in zip(names, totals, strict=True)}
