"""Training on single instants, drawn from several sets by their shares."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import numpy as np
import torch
from torch import Tensor

from pedpred.datasets.rows import TrainingRows
from pedpred.datasets.splits import select_held_out
from pedpred.errors import ValueRuleError
from pedpred.models.contract import ForecastNetwork, Tensors
from pedpred.settings import In
from pedpred.training.distributed import ALONE, DistributedContext
from pedpred.training.learner import Examples, FitSettings
from pedpred.training.masking import InputMasking, mask

_ROWS_AT_ONCE = 4096


@dataclass(frozen=True, kw_only=True)
class InstantSettings(FitSettings):
    """How a network without memory is trained, on single instants.

    Attributes:
        rows: per step, by all processes together.
        shares: set -> its share of the rows; they need not sum to 1.
        validation_share: of the worlds of each set.
        masking: see `InputMasking`.
    """

    betas: ClassVar[tuple[float, float]] = (0.9, 0.98)
    keeps_best: ClassVar[bool] = False

    rows: Annotated[int, In("[1, 1000000]")]
    shares: Mapping[str, Annotated[float, In("[0, 1e6]")]]
    validation_share: Annotated[float, In("[0, 1)")]
    masking: InputMasking = field(default_factory=InputMasking)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not sum(self.shares.values()) > 0:
            raise ValueRuleError("shares", dict(self.shares), "one of them must be positive")

    def sampler(self, data: TrainingRows, context: DistributedContext) -> InstantSampler:
        """Divide the worlds of each set at random, and draw rows."""
        return InstantSampler(data, self, context)


class InstantSampler:
    """Random rows of some sets, see `Sampler`.

    Attributes:
        training: set -> rows to learn from. [M] each
        validation: rows of the worlds kept for validation. [V]
    """

    def __init__(self, data: TrainingRows, settings: InstantSettings, context: DistributedContext = ALONE):
        """Divide the worlds of each set.

        Args:
            data: the sets that `settings.shares` names.
            settings: see `InstantSettings`.
            context: of this process.
        """
        self.data, self.settings, self.context = data, settings, context
        rng = np.random.default_rng(settings.seed)
        worlds, share = data.by_set, settings.validation_share
        kept = {name: select_held_out(spans, share, rng) for name, spans in worlds.items()}
        self.training = {name: _rows(worlds[name][~kept[name]]) for name in kept}
        self.validation = np.concatenate([_rows(worlds[name][kept[name]]) for name in kept])

    @property
    def lanes(self) -> int:
        """Rows of this process."""
        part = self.context.share(self.settings.rows, "rows")
        return part.stop - part.start

    def batches(self, done: int) -> Iterator[np.ndarray]:
        """Rows of the data, [B] each; those of a step depend on its number alone."""
        how, of_rank = self.settings, self.context.share(self.settings.rows, "rows")
        sets = [(rows, how.shares.get(name, 0.0)) for name, rows in self.training.items() if len(rows)]
        share = np.array([share for _, share in sets]) / sum(share for _, share in sets)
        step = done
        while True:
            rng = np.random.default_rng([how.seed, step])
            each = rng.multinomial(how.rows, share)
            drawn = [rows[rng.integers(len(rows), size=n)] for (rows, _), n in zip(sets, each, strict=True)]
            yield rng.permutation(np.concatenate(drawn))[of_rank]
            step += 1

    def examples(self, batch: np.ndarray, step: int) -> Examples:
        """See `Sampler.examples`; parts of the inputs are masked."""
        rng = np.random.default_rng([self.settings.seed, step, self.context.rank])
        rows = torch.from_numpy(batch).to(self.data.future.device)
        empty = self.data.row_format.features.empty_channels()
        inputs = mask(self.data.inputs(rows), self.settings.masking, empty, rng)
        starts = torch.ones_like(rows, dtype=torch.bool)
        return Examples(inputs, self.data.future[rows], self.data.known(rows), starts)

    def outputs(self, network: ForecastNetwork) -> Iterator[tuple[Tensor, Tensors]]:
        """In the worlds kept for validation, as precise as in training."""
        validation = self.validation[self.context.rank :: self.context.size]
        for at in range(0, len(validation), _ROWS_AT_ONCE):
            rows = torch.from_numpy(validation[at : at + _ROWS_AT_ONCE]).to(self.data.future.device)
            with torch.inference_mode(), self.context.precision():
                outputs, _ = network(self.data.inputs(rows), network.start(len(rows)))
            yield rows, outputs


def _rows(spans: np.ndarray) -> np.ndarray:
    """All rows of some spans [first, last). [S, 2] -> [M] int64."""
    return np.concatenate([np.zeros(0, np.int64), *(np.arange(*span) for span in spans)])
