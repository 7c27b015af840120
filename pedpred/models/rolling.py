"""Run a motion network along whole tracks, memory carried from the first step to the last."""

from __future__ import annotations

import numpy as np
import torch

from pedpred.datasets.motion import MotionData
from pedpred.models.motion import MotionLstm

_TRACKS_AT_ONCE = 256
_STEPS_AT_ONCE = 32


@torch.inference_mode()
def roll(network: MotionLstm, data: MotionData, sequences: np.ndarray) -> torch.Tensor:
    """Forecast at every step of some sequences.

    Args:
        network: in evaluation mode.
        data: inputs.
        sequences: rows [first, last) of each track. [S, 2]

    Returns:
        Future velocities, agent frame, m/s, for the rows of `data`; 0 for rows that are in no
        sequence. [M, P, 2]
    """
    forecast = torch.zeros_like(data.future)
    by_length = sequences[np.argsort(sequences[:, 0] - sequences[:, 1], kind="stable")]
    for at in range(0, len(by_length), _TRACKS_AT_ONCE):
        first, last = by_length[at : at + _TRACKS_AT_ONCE].T
        state = network.start(len(first))
        for begin in range(0, int((last - first).max()), _STEPS_AT_ONCE):
            rows = first[:, None] + begin + np.arange(_STEPS_AT_ONCE)
            rows = torch.from_numpy(np.where(rows < last[:, None], rows, -1)).to(forecast.device)
            velocities, state = network(data.inputs(rows), state)
            forecast[rows[rows >= 0]] = velocities[rows >= 0]
    return forecast


def displacement_errors(velocities: torch.Tensor, truth: torch.Tensor, dt_s: float) -> torch.Tensor:
    """Distance of the integrated paths at every step, m. [..., P, 2] x 2 -> [..., P]."""
    return torch.linalg.vector_norm(torch.cumsum((velocities - truth) * dt_s, dim=-2), dim=-1)
