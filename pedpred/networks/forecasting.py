"""A trained network as a forecaster (`pedpred.forecasting.Forecaster`)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from pedpred.datasets.motion import network_inputs
from pedpred.features import FeatureSettings, FeatureTable
from pedpred.forecasting import ForecastRequest
from pedpred.forecasting.tensors import predictions_of
from pedpred.networks.autoencoder import GridEncoder
from pedpred.networks.contract import RecurrentNetwork, Tensors
from pedpred.networks.encoding import encode, load_encoder
from pedpred.networks.registry import load_network
from pedpred.networks.rolling import recall
from pedpred.scenes import Predictions
from pedpred.tracking.tracks import TIME_TOLERANCE_S, last_rows


@dataclass(frozen=True)
class NetworkForecaster:
    """Runs a network along the clock of a request, so that its memory builds up as on a robot.

    An instant between two steps is forecast from its own inputs and the memory of the last step.

    Attributes:
        network: trained.
        encoder: the frozen convolutions; None for a network that does not read the grid.
    """

    network: RecurrentNetwork
    encoder: GridEncoder | None

    def __call__(self, request: ForecastRequest) -> Predictions:
        """World-frame predictions of the request's rows.

        Raises:
            ValueRuleError: the request has no clock.
        """
        steps, asked, sizes = request.steps, request.asked, request.sizes
        if not len(asked):
            return Predictions.single(np.zeros((0, sizes.horizon_steps, 2)), sizes.dt_s)
        latest = last_rows(steps.track_id, steps.time_s, asked.track_id, asked.time_s)
        first = latest - steps.step[latest]
        on_step = steps.time_s[latest] >= asked.time_s - TIME_TOLERANCE_S
        before = steps.step[latest] + ~on_step
        inputs = self._inputs(steps, asked, sizes)
        outputs = recall(self.network, inputs[0], inputs[1], first, before, on_step)
        with torch.inference_mode():
            answer = {
                name: values.numpy() for name, values in self.network.answer(outputs, sizes.dt_s).items()
            }
        return predictions_of(answer, sizes.dt_s).in_world(asked.position, asked.heading_rad)

    def _inputs(self, steps: FeatureTable, asked: FeatureTable, sizes: FeatureSettings) -> list[Tensors]:
        """The network's inputs in two tables; equal crops are encoded once."""
        embeddings: list[np.ndarray | None] = [None, None]
        if self.encoder is not None:
            crops = np.concatenate([steps.occupancy, asked.occupancy])
            different, index = np.unique(crops, axis=0, return_inverse=True)
            embedded = encode(self.encoder, different, sizes.grid_cells)[index.ravel()]
            embeddings = [embedded[: len(steps)], embedded[len(steps) :]]
        pairs = zip((steps, asked), embeddings, strict=True)
        return [network_inputs(table, sizes, own) for table, own in pairs]


def forecaster(network_folder: Path, autoencoder_folder: Path) -> NetworkForecaster:
    """The forecaster of a checkpoint; the auto-encoder is read only if the network reads the grid.

    Raises:
        StorageError: a checkpoint is missing or damaged.
    """
    network = load_network(network_folder)
    reads_grid = "grid" in network.settings.channels_read
    return NetworkForecaster(network, load_encoder(autoencoder_folder) if reads_grid else None)
