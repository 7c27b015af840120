"""Left and right exchanged: layers that read what a person sees, and its mirror image."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn.functional import linear


class MirroredLinear(nn.Linear):
    """A layer that reads some facts and, if `sides` is 2, also their mirror image.

    The same numbers come in; the signs of the mirror image are in the weights, so that nothing is read twice.

    Attributes:
        sides: 1 or 2.
        left: -1 for facts that change their sign with left and right, 1 for others. [in]
    """

    def __init__(self, left: Sequence[float], units: int, sides: int):
        super().__init__(len(left), units)
        self.left, self.sides = tuple(left), sides

    def forward(self, facts: Tensor) -> Tensor:
        """Facts [M, in] -> a row for each side [M * sides, units]."""
        return linear(facts, self.both, self.bias.repeat(self.sides)).reshape(-1, self.out_features)

    @property
    def both(self) -> Tensor:
        """The weights of each side. [sides * units, in]."""
        return torch.cat([self.weight, self.weight * self.weight.new_tensor(self.left)][: self.sides])


def mirrored_beams(beams: Tensor) -> Tensor:
    """Distances along beams as seen in a mirror; beam 0 points along the heading. [N, beams]."""
    return torch.cat([beams[:, :1], beams[:, 1:].flip(-1)], dim=-1)
