"""A trained network as a forecaster (`pedpred.forecasting.Forecaster`), run along whole tracks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from pedpred.datasets.motion import MotionData, motion_data
from pedpred.features import FeatureSettings, FeatureTable
from pedpred.forecasting import ForecastRequest
from pedpred.forecasting.tensors import predictions_of
from pedpred.networks.autoencoder import GridEncoder, encode, load_encoder
from pedpred.networks.contract import RecurrentNetwork, Tensors, select
from pedpred.networks.registry import load_network
from pedpred.scenes import Predictions

_TRACKS_AT_ONCE = 256
_STEPS_AT_ONCE = 32


@dataclass(frozen=True)
class NetworkForecaster:
    """Runs a network over the whole table of a request, so that its state builds up as on a robot.

    Attributes:
        network: trained.
        encoder: the frozen convolutions; None for a network that does not read the grid.
    """

    network: RecurrentNetwork
    encoder: GridEncoder | None

    def __call__(self, request: ForecastRequest) -> Predictions:
        """World-frame predictions of the request's rows."""
        return self.predict(request.table, request.sizes, request.rows)

    def predict(self, table: FeatureTable, sizes: FeatureSettings, rows: np.ndarray) -> Predictions:
        """World-frame predictions of some rows [W] of a whole table that was made with `sizes`."""
        embeddings = None if self.encoder is None else encode(self.encoder, table.occupancy, sizes.grid_cells)
        data = motion_data(table, sizes, embeddings)
        outputs = select(roll(self.network, data, data.sequences), torch.from_numpy(rows))
        with torch.inference_mode():
            answer = {
                name: values.numpy() for name, values in self.network.answer(outputs, sizes.dt_s).items()
            }
        return predictions_of(answer, sizes.dt_s).in_world(table.position[rows], table.heading_rad[rows])


def forecaster(network_folder: Path, autoencoder_folder: Path) -> NetworkForecaster:
    """The forecaster of a checkpoint; the auto-encoder is read only if the network reads the grid.

    Raises:
        StorageError: a checkpoint is missing or damaged.
    """
    network = load_network(network_folder)
    reads_grid = "grid" in network.settings.channels_read
    return NetworkForecaster(network, load_encoder(autoencoder_folder) if reads_grid else None)


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
