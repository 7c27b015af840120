"""A trained network as a forecaster (`pedpred.forecasting.Forecaster`)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from pedpred.datasets.motion import motion_data
from pedpred.features import FeatureSettings, FeatureTable
from pedpred.forecasting import ForecastRequest
from pedpred.forecasting.tensors import predictions_of
from pedpred.networks.autoencoder import GridEncoder
from pedpred.networks.contract import RecurrentNetwork, select
from pedpred.networks.encoding import encode, load_encoder
from pedpred.networks.registry import load_network
from pedpred.networks.rolling import roll
from pedpred.scenes import Predictions


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
