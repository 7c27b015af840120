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
    """What is masked in some rows; nothing by default, nor of channels that an input set does not have.

    Attributes:
        map_share: of the rows: no obstacle is known.
        neighbours_share: of the rows: nobody else is seen.
        missed_share: of the rows: each neighbour is left out with the probability `missed`.
        missed: see `missed_share`.
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
        inputs: channel -> [B, width]; "beams", "neighbours" and "history" are those of `MixtureFeatures`.
        how: shares.
        empty: of `ModelFeatures.empty_channels`: beams that meet nothing.
        rng: decides which rows and parts.
    """
    masked, first = dict(inputs), next(iter(inputs.values()))
    count, device = len(first), first.device

    def drawn(share: float, *axes: int) -> Tensor:
        return torch.from_numpy(rng.random((count, *axes)) < share).to(device)

    if "beams" in inputs:
        masked["beams"] = torch.where(drawn(how.map_share, 1), empty["beams"], inputs["beams"])
    if "neighbours" in inputs:
        people = inputs["neighbours"].unflatten(-1, (-1, NEIGHBOUR))
        some = drawn(how.missed, people.shape[1]) & drawn(how.missed_share, 1)
        missed = some | drawn(how.neighbours_share, 1)
        masked["neighbours"] = torch.where(missed[..., None], 0.0, people).flatten(-2)
    if "history" in inputs:
        past = inputs["history"].unflatten(-1, (-1, PAST))
        least = torch.from_numpy(rng.integers(1, past.shape[1] + 1, (count, 1))).to(device)
        gone = (torch.arange(past.shape[1], device=device) >= least) & drawn(how.past_share, 1)
        masked["history"] = torch.where(gone[..., None], 0.0, past).flatten(-2)
    return masked
