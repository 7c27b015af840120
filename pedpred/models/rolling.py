"""Run a recurrent network along whole tracks, and look in between their steps."""

from __future__ import annotations

import numpy as np
import torch

from pedpred.models.contract import ForecastNetwork, Tensors, select

_TRACKS_AT_ONCE = 256


def outputs_at_instants(
    network: ForecastNetwork,
    steps: Tensors,
    asked: Tensors,
    first: np.ndarray,
    before: np.ndarray,
    on_step: np.ndarray,
) -> Tensors:
    """Outputs at any instants: those of a step, or of fresh inputs with the memory of the steps before.

    Args:
        network: in evaluation mode.
        steps: inputs at all steps, track by track, channel -> [M, width].
        asked: inputs at the instants, channel -> [W, width].
        first: row of `steps` at which the track of each instant starts. [W]
        before: number of that track's steps before the instant. [W]
        on_step: whether the instant is that of the step that follows them. [W] bool

    Returns:
        [W, ...] each
    """
    start, lane = np.unique(first, return_inverse=True)
    length = np.zeros(len(start), np.int64)  # number of steps that each track is needed for
    np.maximum.at(length, lane, before + on_step)
    by_length = np.argsort(-length, kind="stable")
    # Sorted, the longest track first; lane: place of each instant's track in this order.
    start, length, lane = start[by_length], length[by_length], np.argsort(by_length)[lane]
    whole: Tensors = {}
    for at in range(0, len(start), _TRACKS_AT_ONCE):
        block = slice(at, at + _TRACKS_AT_ONCE)
        state = network.start(len(start[block]))
        in_block = np.flatnonzero((lane >= at) & (lane < block.stop))
        for step in range(before[in_block].max() + 1):
            going = int((length[block] > step).sum())  # longer tracks come first
            due = in_block[before[in_block] == step]
            between = due[~on_step[due]]
            rows, fresh = torch.from_numpy(start[block][:going] + step), torch.from_numpy(between)
            inputs = {name: torch.cat([steps[name][rows], asked[name][fresh]])[:, None] for name in steps}
            lanes = torch.from_numpy(np.concatenate([np.arange(going), lane[between] - at]))
            with torch.inference_mode():
                outputs, state = network(inputs, select(state, lanes))
            state = select(state, slice(going))
            # source: row of `outputs` for each instant that is due
            source = np.where(on_step[due], lane[due] - at, going + np.cumsum(~on_step[due]) - 1)
            for name, values in outputs.items():
                if name not in whole:
                    whole[name] = values.new_zeros(len(before), *values.shape[2:])
                whole[name][torch.from_numpy(due)] = values[torch.from_numpy(source), 0]
    return whole
