"""Run a motion network along whole tracks, memory carried from the first step to the last."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import torch

from pedpred.datasets.motion import MotionData
from pedpred.networks.lstm import Motion, MotionLstm

_TRACKS_AT_ONCE = 256
_STEPS_AT_ONCE = 32


@torch.inference_mode()
def roll(network: MotionLstm, data: MotionData, sequences: np.ndarray) -> Motion:
    """Forecast at every step of some sequences; arguments of `rolled`.

    Returns:
        Motion in agent frames for the rows of `data`; 0 for rows that are in no sequence. [M, ...]
    """
    velocities = torch.zeros_like(data.future)
    spread = None if network.uncertainty is None else velocities.new_zeros(*velocities.shape[:2], 3)
    for rows, motion in rolled(network, data, sequences):
        velocities[rows] = motion.velocities
        if spread is not None and motion.spread is not None:
            spread[rows] = motion.spread
    return Motion(velocities, spread)


def rolled(
    network: MotionLstm, data: MotionData, sequences: np.ndarray
) -> Iterator[tuple[torch.Tensor, Motion]]:
    """Forecast at every step of some sequences, a block of rows after the other, which bounds the memory.

    Args:
        network: in evaluation mode.
        data: inputs.
        sequences: rows [first, last) of each track. [S, 2]

    Yields:
        Rows [m], each row of a sequence once, and the motion there in agent frames. [m, ...]
    """
    by_length = sequences[np.argsort(sequences[:, 0] - sequences[:, 1], kind="stable")]
    for at in range(0, len(by_length), _TRACKS_AT_ONCE):
        first, last = by_length[at : at + _TRACKS_AT_ONCE].T
        state = network.start(len(first))
        for begin in range(0, int((last - first).max()), _STEPS_AT_ONCE):
            steps = first[:, None] + begin + np.arange(_STEPS_AT_ONCE)
            rows = torch.from_numpy(np.where(steps < last[:, None], steps, -1)).to(data.future.device)
            with torch.inference_mode():  # not around `yield`: it would hold in the caller, too
                motion, state = network(data.inputs(rows), state)
            real = rows >= 0
            spread = None if motion.spread is None else motion.spread[real]
            yield rows[real], Motion(motion.velocities[real], spread)


def displacements(velocities: torch.Tensor, truth: torch.Tensor, dt_s: float) -> torch.Tensor:
    """From the forecast to the true path, both integrated, m. [..., P, 2] x 2 -> [..., P, 2]."""
    return torch.cumsum((truth - velocities) * dt_s, dim=-2)
