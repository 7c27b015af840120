"""Training of recurrent networks by truncated back-propagation through time: all phases of the curriculum."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
from torch.nn.utils import clip_grad_norm_

from pedpred.datasets.lanes import SplitSettings, split_sequences, stream_lanes
from pedpred.datasets.rows import TrainingRows, load_sequences
from pedpred.errors import ValueRuleError
from pedpred.models.contract import ForecastNetwork, Loss, detach, reset, select
from pedpred.models.lstm.augmentation import Augmentation, AugmentedBatch, augment, look_up
from pedpred.models.rolling import rolled
from pedpred.settings import In, Settings
from pedpred.training.distributed import ALONE, DistributedContext
from pedpred.training.loop import Learner
from pedpred.training.schedule import FitSettings

_SEED_DISTANCE = 1_000_003
"""Between the seeds of two processes, so that they do not drop the same units."""


@dataclass(frozen=True, kw_only=True)
class NamedSets(Settings):
    """What a phase is trained on, whatever the fold.

    Attributes:
        sets: kind/name of each, below data/rows.
    """

    sets: tuple[str, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.sets:
            raise ValueRuleError("sets", self.sets, "it must name a set such as simulated/main")


@dataclass(frozen=True, kw_only=True)
class SequenceSettings(FitSettings, SplitSettings):
    """How a network with a memory is trained, on the steps of whole tracks.

    Attributes:
        lanes: tracks that are streamed side by side, B; by all processes together.
        sub_sequence: truncation depth L, steps.
        longest_track: tracks are cut into pieces of at most this many steps.
        augmentation: see there.
    """

    lanes: Annotated[int, In("[1, 100000]")]
    sub_sequence: Annotated[int, In("[1, 10000]")]
    longest_track: Annotated[int, In("[1, 1000000]")]
    augmentation: Augmentation = field(default_factory=Augmentation)

    def __post_init__(self) -> None:
        FitSettings.__post_init__(self)
        SplitSettings.__post_init__(self)

    def load(self, folders: Mapping[str, Path], embeddings: Mapping[str, Path] | None) -> TrainingRows:
        """All steps of the tracks of some sets; see `load_sequences`."""
        return load_sequences(folders, embeddings)

    def learner(
        self, network: ForecastNetwork, rows: TrainingRows, context: DistributedContext
    ) -> SequenceLearner:
        """Divide the sequences."""
        divided = split_sequences(rows, self, np.random.default_rng(self.seed))
        return SequenceLearner(network, rows, *divided, self, context)


@dataclass(eq=False)
class SequenceLearner(Learner):
    """A network with a memory, its rows and the state of its lanes.

    Attributes:
        network: initialised, on the context's device; the starting weights count as the first candidate.
        data: all rows, on the same device.
        training: rows [first, last) of the sequences to learn from. [S, 2]
        validation: rows [first, last) of the sequences to choose the weights by. [S, 2]
    """

    network: ForecastNetwork
    data: TrainingRows
    training: np.ndarray
    validation: np.ndarray
    settings: SequenceSettings
    context: DistributedContext = ALONE

    def __post_init__(self) -> None:
        settings = self.settings
        self.optimizer = torch.optim.AdamW(
            self.network.parameters(), lr=settings.lr, weight_decay=settings.weight_decay, fused=True
        )
        self.lanes = self.context.share(settings.lanes)
        self.memory = self.network.start(self.lanes.stop - self.lanes.start)
        self.best_by = f"validation_{self.network.score_names[0]}"

    def batches(self, done: int) -> Iterator[AugmentedBatch]:
        """This process's part of the endless stream of lanes, without the steps that are done."""
        how, rng = self.settings, np.random.default_rng(self.settings.seed)
        stream = stream_lanes(self.training, how.lanes, how.sub_sequence, how.longest_track, rng)
        for step, batch in enumerate(islice(stream, done, None), done):
            whole = augment(batch, how.augmentation, np.random.default_rng([how.seed, step]))
            yield whole.part(self.lanes, self.context.device)

    def loss(self, batch: AugmentedBatch, step: int) -> Loss:
        """One sub-sequence of every lane; the state is carried on, the gradient is not."""
        # Dropout is the same when the training is resumed.
        torch.manual_seed(self.settings.seed + step + _SEED_DISTANCE * self.context.rank)
        inputs, future = look_up(self.data, batch)
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
        """Mean scores over all steps whose whole horizon is known; nan where there is none.

        The processes of a training divide the sequences among them.

        Returns:
            "validation_<score>" for each of the network's scores.
        """
        names = [f"validation_{name}" for name in self.network.score_names]
        data, rows_of_rank = self.data, self.validation[self.context.rank :: self.context.size]
        sums = torch.zeros(len(names) + 1, dtype=torch.float64, device=data.future.device)  # and how many
        for rows, outputs in rolled(self.network, data, rows_of_rank):
            known = data.known(rows).all(dim=-1)
            truth = data.future[rows[known]]
            scores = list(self.network.scores(select(outputs, known), truth, data.dt_s).values())
            counted = sums.new_tensor(scores[0].numel())
            sums += torch.stack([*(score.double().sum() for score in scores), counted])
        *totals, count = self.context.total(sums).tolist()
        return {n: total / count if count else float("nan") for n, total in zip(names, totals, strict=True)}
