"""What the motion network is asked for: velocities (Pfeiffer et al. 2018, eq. 5) and how far off they are."""

from __future__ import annotations

import torch
from torch import Tensor

from pedpred.networks.gaussian import negative_log_density
from pedpred.networks.lstm import Motion
from pedpred.networks.rolling import displacements


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


def spread_loss(motion: Motion, truth: Tensor, known: Tensor, dt_s: float) -> Tensor:
    """Mean negative log likelihood of the true positions, nats, over everything known.

    The mean is taken as given: only the spread learns from this. 0 for a network that tells no spread.

    Args:
        motion: forecast. [..., P, ...]
        truth: velocities, agent frame, m/s. [..., P, 2]
        known: which target steps count. [..., P] bool
        dt_s: time between steps, s.
    """
    if motion.spread is None:
        return motion.velocities.new_zeros(())
    error = displacements(motion.velocities.detach(), truth, dt_s)
    surprise = negative_log_density(error, motion.spread)
    return (surprise * known).sum() / known.sum().clamp(min=1)
