"""What the motion network is asked for (Pfeiffer et al. 2018, eq. 5)."""

from __future__ import annotations

import torch
from torch import Tensor


def velocity_loss(predicted: Tensor, truth: Tensor, known: Tensor) -> Tensor:
    """Mean Euclidean distance of velocities, (1/P) sum_l |u(l) - v(l)|, over everything known.

    The regularisation term of the equation is the optimiser's (decoupled) weight decay.

    Args:
        predicted: m/s. [..., P, 2]
        truth: m/s. [..., P, 2]
        known: which target velocities count. [..., P] bool
    """
    distance = torch.linalg.vector_norm(predicted - truth, dim=-1)
    return (distance * known).sum() / known.sum().clamp(min=1)
