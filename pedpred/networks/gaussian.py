"""How far off a forecast may be: a 2D Gaussian of the position error at every step of the horizon.

The error e = (forward, left) of a step is told in two parts, first forward, then what is left given that:
    e_x ~ N(0, a^2),    e_y | e_x ~ N(k e_x, c^2)
    Sigma = [[a^2, k a^2], [k a^2, k^2 a^2 + c^2]],    det Sigma = a^2 c^2
(modified Cholesky decomposition, Pourahmadi 1999, Biometrika 86, eq. 2). Any a, c > 0 and any k give a
covariance, so nothing has to be clipped.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.functional import softplus

FLOOR_M = 0.01
"""Least standard deviation, m: people's own sway and the annotators' clicks are not smaller."""

_FIRST_GUESS_M = 0.05
"""Standard deviation per step of the horizon before anything is learned, m."""


class GaussianHead(nn.Module):
    """From the joint memory to the spread (a, c, k) of the position error at every step.

    It looks at the memory without moving it (its gradient ends there), so that forecasts are to the last
    bit what they are without it.
    """

    def __init__(self, units: int, horizon_steps: int):
        super().__init__()
        self.out = nn.Linear(units, 3 * horizon_steps)
        guess = _FIRST_GUESS_M * torch.arange(1.0, horizon_steps + 1)[:, None]
        with torch.no_grad():  # softplus(ln(e^s - 1)) = s
            self.out.bias.view(-1, 3)[:] = guess.expm1().log() * torch.tensor([1.0, 1.0, 0.0])

    def forward(self, memory: Tensor) -> Tensor:
        """Spread of the position error, agent frame. [..., units] -> [..., P, 3]: a (m), c (m), k."""
        raw = self.out(memory.detach()).unflatten(-1, (-1, 3))
        return torch.cat([FLOOR_M + softplus(raw[..., :2]), raw[..., 2:]], dim=-1)


UNCERTAINTIES = {"gaussian": GaussianHead}
"""What else a network can tell of its error; "none" tells nothing."""


def covariance_of(spread: Tensor) -> Tensor:
    """Covariance Sigma of a spread (a, c, k), m^2. [..., 3] -> [..., 2, 2]."""
    a, c, k = spread.unbind(-1)
    shared = k * a.square()
    entries = torch.stack([a.square(), shared, shared, k * shared + c.square()], dim=-1)
    return entries.unflatten(-1, (2, 2))


def negative_log_density(error: Tensor, spread: Tensor) -> Tensor:
    """Negative logarithm of the Gaussian density, nats (density per m^2).

    -ln N(e; 0, Sigma) = ln(2 pi a c) + e_x^2 / (2 a^2) + (e_y - k e_x)^2 / (2 c^2)

    Args:
        error: position error, agent frame, m. [..., 2]
        spread: see `GaussianHead`. [..., 3]

    Returns:
        [...]
    """
    a, c, k = spread.unbind(-1)
    forward, left = error.unbind(-1)
    misses = (forward / a).square() + ((left - k * forward) / c).square()
    return torch.log(2 * torch.pi * a * c) + 0.5 * misses
