"""Training on the steps of whole tracks, by truncated back-propagation through time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from itertools import islice
from typing import Annotated, ClassVar

import numpy as np
import torch
from torch import Tensor

from pedpred.datasets.lanes import stream_lanes
from pedpred.datasets.rows import TrainingRows
from pedpred.datasets.splits import SplitSettings, split_sequences
from pedpred.models.contract import ForecastNetwork, Tensors, select
from pedpred.settings import In
from pedpred.training.augmentation import Augmentation, AugmentedBatch, augment, look_up
from pedpred.training.distributed import ALONE, DistributedContext
from pedpred.training.learner import Examples, FitSettings

_TRACKS_AT_ONCE = 256
_STEPS_AT_ONCE = 32


@dataclass(frozen=True, kw_only=True)
class SequenceSettings(FitSettings, SplitSettings):
    """How a network with a memory is trained, on the steps of whole tracks.

    Attributes:
        lanes: tracks that are streamed side by side, B; by all processes together.
        sub_sequence: truncation depth L, steps.
        longest_track: tracks are cut into pieces of at most this many steps.
        augmentation: see `Augmentation`.
    """

    betas: ClassVar[tuple[float, float]] = (0.9, 0.999)
    keeps_best: ClassVar[bool] = True

    lanes: Annotated[int, In("[1, 100000]")]
    sub_sequence: Annotated[int, In("[1, 10000]")]
    longest_track: Annotated[int, In("[1, 1000000]")]
    augmentation: Augmentation = field(default_factory=Augmentation)

    def sampler(self, data: TrainingRows, context: DistributedContext) -> SequenceSampler:
        """Divide the sequences at random, and stream them."""
        divided = split_sequences(data, self, np.random.default_rng(self.seed))
        return SequenceSampler(data, *divided, self, context)


@dataclass(frozen=True, eq=False)
class SequenceSampler:
    """Sub-sequences of the tracks in some lanes, see `Sampler`.

    Attributes:
        data: all rows.
        training: rows [first, last) of the sequences to learn from. [S, 2]
        validation: rows [first, last) of the sequences to choose the weights by. [S, 2]
        settings: see `SequenceSettings`.
        context: of this process.
    """

    data: TrainingRows
    training: np.ndarray
    validation: np.ndarray
    settings: SequenceSettings
    context: DistributedContext = ALONE

    @property
    def lanes(self) -> int:
        """Lanes of this process."""
        part = self.context.share(self.settings.lanes)
        return part.stop - part.start

    def batches(self, done: int) -> Iterator[AugmentedBatch]:
        """One sub-sequence of every lane of this process, see `Sampler.batches`."""
        how, rng = self.settings, np.random.default_rng(self.settings.seed)
        stream = stream_lanes(self.training, how.lanes, how.sub_sequence, how.longest_track, rng)
        part = self.context.share(how.lanes)
        for step, batch in enumerate(islice(stream, done, None), done):
            whole = augment(batch, how.augmentation, np.random.default_rng([how.seed, step]))
            yield whole.part(part, self.context.device)

    def examples(self, batch: AugmentedBatch, step: int) -> Examples:
        """See `Sampler.examples`."""
        inputs, future = look_up(self.data, batch)
        return Examples(inputs, future, self.data.known(batch.rows), batch.starts)

    def outputs(self, network: ForecastNetwork) -> Iterator[tuple[Tensor, Tensors]]:
        """At every step of this process's validation sequences, as precise as in training."""
        own = self.validation[self.context.rank :: self.context.size]
        return run_over_sequences(network, self.data, own, self.context.precision)


def run_over_sequences(
    network: ForecastNetwork,
    data: TrainingRows,
    sequences: np.ndarray,
    precision: Callable[[], AbstractContextManager[object]] = nullcontext,
) -> Iterator[tuple[Tensor, Tensors]]:
    """Outputs at every step of some sequences, in blocks of rows, which bounds the memory.

    Args:
        network: in evaluation mode.
        data: inputs.
        sequences: rows [first, last) of each track. [S, 2]
        precision: makes a context for the forward pass; by default single precision.

    Yields:
        Rows [m], each row of a sequence once, and the outputs there. [m, ...] each
    """
    by_length = sequences[np.argsort(sequences[:, 0] - sequences[:, 1], kind="stable")]
    for at in range(0, len(by_length), _TRACKS_AT_ONCE):
        first, last = by_length[at : at + _TRACKS_AT_ONCE].T
        state = network.start(len(first))
        longest = int((last - first).max())
        for begin in range(0, longest, _STEPS_AT_ONCE):
            steps = first[:, None] + np.arange(begin, min(begin + _STEPS_AT_ONCE, longest))
            rows = torch.from_numpy(np.where(steps < last[:, None], steps, -1)).to(data.future.device)
            with torch.inference_mode(), precision():  # not around `yield`: it would hold in the caller, too
                outputs, state = network(data.inputs(rows), state)
            real = rows >= 0
            yield rows[real], select(outputs, real)
