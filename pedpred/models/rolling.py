"""Run a motion network along whole tracks, memory carried from the first step to the last."""

from __future__ import annotations

import numpy as np
import torch

from pedpred.datasets.motion import MotionData
from pedpred.models.motion import Motion, MotionLstm

_TRACKS_AT_ONCE = 256
_STEPS_AT_ONCE = 32


@torch.inference_mode()
def roll(network: MotionLstm, data: MotionData, sequences: np.ndarray) -> Motion:
    """Forecast at every step of some sequences.

    Args:
        network: in evaluation mode.
        data: inputs.
        sequences: rows [first, last) of each track. [S, 2]

    Returns:
        Motion in agent frames for the rows of `data`; 0 for rows that are in no sequence. [M, ...]
    """
    velocities = torch.zeros_like(data.future)
    spread = None if network.uncertainty is None else velocities.new_zeros(*velocities.shape[:2], 3)
    by_length = sequences[np.argsort(sequences[:, 0] - sequences[:, 1], kind="stable")]
    for at in range(0, len(by_length), _TRACKS_AT_ONCE):
        first, last = by_length[at : at + _TRACKS_AT_ONCE].T
        state = network.start(len(first))
        for begin in range(0, int((last - first).max()), _STEPS_AT_ONCE):
            rows = first[:, None] + begin + np.arange(_STEPS_AT_ONCE)
            rows = torch.from_numpy(np.where(rows < last[:, None], rows, -1)).to(velocities.device)
            motion, state = network(data.inputs(rows), state)
            velocities[rows[rows >= 0]] = motion.velocities[rows >= 0]
            if spread is not None:
                spread[rows[rows >= 0]] = motion.spread[rows >= 0]
    return Motion(velocities, spread)


def displacements(velocities: torch.Tensor, truth: torch.Tensor, dt_s: float) -> torch.Tensor:
    """From the forecast to the true path, both integrated, m. [..., P, 2] x 2 -> [..., P, 2]."""
    return torch.cumsum((truth - velocities) * dt_s, dim=-2)
