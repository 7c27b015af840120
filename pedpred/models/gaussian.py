"""Uncertainty of a forecast: a 2D Gaussian of the position error at every step of the horizon.

The error e = (forward, left) of a step is factorised, forward first, then left given forward:
    e_x ~ N(0, a^2),    e_y | e_x ~ N(k e_x, c^2)
    Sigma = [[a^2, k a^2], [k a^2, k^2 a^2 + c^2]],    det Sigma = a^2 c^2
(modified Cholesky decomposition, Pourahmadi 1999, Biometrika 86, eq. 2). Any a, c > 0 and any k give a
valid covariance, so nothing has to be clipped.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

FLOOR_M = 0.01
"""Smallest standard deviation, m: body sway and annotation errors are not smaller."""

_INITIAL_M = 0.05
"""Standard deviation per step of the horizon before training, m."""


class GaussianHead(nn.Module):
    """Maps the joint hidden state to the spread (a, c, k) of the position error at every step.

    No gradient flows back into the hidden state, so the point forecasts are bit for bit those of a network
    without this head.
    """

    def __init__(self, units: int, horizon_steps: int):
        super().__init__()
        self.out = nn.Linear(units, 3 * horizon_steps)
        with torch.no_grad():
            self.out.bias.view(-1, 3)[:] = initial_spread(horizon_steps)

    def forward(self, hidden: Tensor) -> Tensor:
        """Spread of the position error, agent frame. [..., units] -> [..., P, 3]: a (m), c (m), k."""
        return spread_of(self.out(hidden.detach()).unflatten(-1, (-1, 3)))


def initial_spread(horizon_steps: int) -> Tensor:
    """What `spread_of` turns into a spread that grows with the horizon. [P, 3]."""
    cpu = torch.device("cpu")  # on "meta", where networks are built before they are read, it takes seconds
    guess = _INITIAL_M * torch.arange(1.0, horizon_steps + 1, device=cpu)[:, None]
    return guess.expm1().log() * torch.tensor([1.0, 1.0, 0.0], device=cpu)  # softplus(ln(e^s - 1)) = s


def spread_of(raw: Tensor) -> Tensor:
    """Any numbers as a valid spread. [..., 3] -> [..., 3]: a (m), c (m), k."""
    return torch.cat([FLOOR_M + _softplus(raw[..., :2]), raw[..., 2:]], dim=-1)


def _softplus(values: Tensor) -> Tensor:
    """ln(1 + e^x), from functions that runtimes have for whole vectors: theirs takes four times as long."""
    return values.relu() + values.abs().neg().exp().log1p()


UNCERTAINTIES = {"gaussian": GaussianHead}
"""Heads that estimate the uncertainty, by the name in the settings."""


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
