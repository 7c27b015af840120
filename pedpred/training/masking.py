"""Input masking: parts of the inputs that are left out in training, so that a network can do without."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import torch
from torch import Tensor

from pedpred.models.mixture.features.history import PAST
from pedpred.models.mixture.features.nearest import NEIGHBOUR
from pedpred.settings import In, Settings


@dataclass(frozen=True)
class InputMasking(Settings):
    """What is masked in some rows; nothing by default.

    Attributes:
        map_share: of the rows: no obstacle is known.
        neighbours_share: of the rows: nobody else is seen.
        missed_share: of the rows: some neighbours are not seen,
        missed: each of them with this probability.
        past_share: of the rows: the past is shorter, by a random number of steps.
    """

    map_share: Annotated[float, In("[0, 1]")] = 0.0
    neighbours_share: Annotated[float, In("[0, 1]")] = 0.0
    missed_share: Annotated[float, In("[0, 1]")] = 0.0
    missed: Annotated[float, In("[0, 1]")] = 0.0
    past_share: Annotated[float, In("[0, 1]")] = 0.0


def mask(
    inputs: dict[str, Tensor], how: InputMasking, empty: Mapping[str, float], rng: np.random.Generator
) -> dict[str, Tensor]:
    """Inputs of which some parts are masked.

    Args:
        inputs: channel -> [B, width].
        how: shares.
        empty: of `ModelFeatures.empty_channels`: beams that meet nothing.
        rng: decides which rows and parts.
    """
    count, device = len(inputs["state"]), inputs["state"].device

    def drawn(share: float, *axes: int) -> Tensor:
        return torch.from_numpy(rng.random((count, *axes)) < share).to(device)

    beams = torch.where(drawn(how.map_share, 1), empty["beams"], inputs["beams"])
    people = inputs["neighbours"].unflatten(-1, (-1, NEIGHBOUR))
    missed = drawn(how.missed, people.shape[1]) & drawn(how.missed_share, 1) | drawn(how.neighbours_share, 1)
    neighbours = torch.where(missed[..., None], 0.0, people).flatten(-2)
    past = inputs["history"].unflatten(-1, (-1, PAST))
    least = torch.from_numpy(rng.integers(1, past.shape[1] + 1, (count, 1))).to(device)
    gone = (torch.arange(past.shape[1], device=device) >= least) & drawn(how.past_share, 1)
    history = torch.where(gone[..., None], 0.0, past).flatten(-2)
    return inputs | {"beams": beams, "neighbours": neighbours, "history": history}
