"""Run a recurrent network along whole tracks, with its state carried from the first step to the last."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import torch

from pedpred.datasets.motion import MotionData
from pedpred.networks.contract import RecurrentNetwork, Tensors, select

_TRACKS_AT_ONCE = 256
_STEPS_AT_ONCE = 32


def roll(network: RecurrentNetwork, data: MotionData, sequences: np.ndarray) -> Tensors:
    """Outputs at every step of some sequences; arguments of `rolled`.

    Returns:
        Outputs for the rows of `data`; 0 for rows that are in no sequence. [M, ...] each
    """
    whole: Tensors = {}
    for rows, outputs in rolled(network, data, sequences):
        for name, values in outputs.items():
            if name not in whole:
                whole[name] = values.new_zeros(len(data.future), *values.shape[1:])
            whole[name][rows] = values
    return whole


def rolled(
    network: RecurrentNetwork, data: MotionData, sequences: np.ndarray
) -> Iterator[tuple[torch.Tensor, Tensors]]:
    """Outputs at every step of some sequences, in blocks of rows, which bounds the memory.

    Args:
        network: in evaluation mode.
        data: inputs.
        sequences: rows [first, last) of each track. [S, 2]

    Yields:
        Rows [m], each row of a sequence once, and the outputs there. [m, ...] each
    """
    by_length = sequences[np.argsort(sequences[:, 0] - sequences[:, 1], kind="stable")]
    for at in range(0, len(by_length), _TRACKS_AT_ONCE):
        first, last = by_length[at : at + _TRACKS_AT_ONCE].T
        state = network.start(len(first))
        for begin in range(0, int((last - first).max()), _STEPS_AT_ONCE):
            steps = first[:, None] + begin + np.arange(_STEPS_AT_ONCE)
            rows = torch.from_numpy(np.where(steps < last[:, None], steps, -1)).to(data.future.device)
            with torch.inference_mode():  # not around `yield`: it would hold in the caller, too
                outputs, state = network(data.inputs(rows), state)
            real = rows >= 0
            yield rows[real], select(outputs, real)
