"""A trained network as a forecaster (`pedpred.forecasting.Forecaster`)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from pedpred.datasets.motion import network_inputs
from pedpred.features import FeatureSettings, FeatureTable
from pedpred.features.situation import tracked_situations
from pedpred.forecasting import ForecastRequest
from pedpred.forecasting.regions import learned
from pedpred.forecasting.selection import consistent
from pedpred.forecasting.tensors import predictions_of
from pedpred.networks.autoencoder import GridEncoder
from pedpred.networks.contract import RecurrentNetwork, Tensors, select
from pedpred.networks.encoding import encode, load_encoder
from pedpred.networks.registry import load_network
from pedpred.networks.rolling import recall
from pedpred.scenes import Predictions
from pedpred.tracking.tracks import TIME_TOLERANCE_S, last_rows

_ROWS_AT_ONCE = 2048


@dataclass(frozen=True)
class NetworkForecaster:
    """Runs a network along the clock of a request, so that its memory builds up as on a robot.

    An instant between two steps is forecast from its own inputs and the memory of the last step. A network
    without memory forecasts everybody present, not only who is asked for, because people choose together.

    Attributes:
        network: trained.
        encoder: the frozen convolutions; None for a network that does not read the grid.
        together: people choose their modes together, see `pedpred.forecasting.selection`.
        learning: regions learn from earlier forecasts, see `pedpred.forecasting.regions`.
    """

    network: RecurrentNetwork
    encoder: GridEncoder | None
    together: bool = True
    learning: bool = True

    def __call__(self, request: ForecastRequest) -> Predictions:
        """World-frame predictions of the request's rows.

        Raises:
            ValueRuleError: the request has no clock.
        """
        asked, sizes = request.asked, request.sizes
        if not len(asked):
            return Predictions.single(np.zeros((0, sizes.horizon_steps, 2)), sizes.dt_s)
        if not self.network.state_shapes:
            return self._present(request)
        predictions = self._answer(self._recalled(request), sizes.dt_s)
        return predictions.in_world(asked.position, asked.heading_rad)

    def _present(self, request: ForecastRequest) -> Predictions:
        """Predictions of a network without memory, for everybody present; those that are asked for."""
        row, time_s, asked = request.present()
        past, sizes, occupancy = request.past, request.sizes, request.scene.occupancy
        channels = tracked_situations(past, row, time_s, occupancy, sizes, request.max_age_s)
        inputs = {name: torch.from_numpy(values)[:, None] for name, values in channels.items()}
        parts = [slice(at, at + _ROWS_AT_ONCE) for at in range(0, len(row), _ROWS_AT_ONCE)]
        with torch.inference_mode():
            found = [self.network(select(inputs, part), {})[0] for part in parts]
        outputs = {name: torch.cat([part[name] for part in found])[:, 0] for name in found[0]}
        here = past.position_at(row, time_s)
        predictions = self._answer(outputs, sizes.dt_s).in_world(here, past.heading_rad[row])
        if self.together:
            predictions = consistent(predictions, here, time_s)
        if self.learning:
            seen = (past.time_s[row] > time_s - TIME_TOLERANCE_S) & past.kept()[row]
            person, detection, noise_m = past.life[row], past.detection[row], request.detection_noise_m
            predictions = learned(predictions, person, time_s, detection, seen, noise_m, sizes.lost_after_s)
        return predictions.select(asked)

    def _answer(self, outputs: Tensors, dt_s: float) -> Predictions:
        """What outputs mean, agent frames."""
        with torch.inference_mode():
            answer = self.network.answer(outputs, dt_s)
        return predictions_of({name: values.numpy() for name, values in answer.items()}, dt_s)

    def _recalled(self, request: ForecastRequest) -> Tensors:
        """Outputs of a recurrent network. [W, ...] each."""
        steps, asked = request.steps, request.asked
        latest = last_rows(steps.track_id, steps.time_s, asked.track_id, asked.time_s)
        first = latest - steps.step[latest]
        on_step = steps.time_s[latest] >= asked.time_s - TIME_TOLERANCE_S
        before = steps.step[latest] + ~on_step
        inputs = self._inputs(steps, asked, request.sizes)
        return recall(self.network, inputs[0], inputs[1], first, before, on_step)

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


def forecaster(network_folder: Path, autoencoder_folder: Path, **choices: bool) -> NetworkForecaster:
    """The forecaster of a checkpoint; the auto-encoder is read only if the network reads the grid.

    Args:
        network_folder: the checkpoint.
        autoencoder_folder: the checkpoint of the encoder.
        choices: `together` and `learning` of `NetworkForecaster`.

    Raises:
        StorageError: a checkpoint is missing or damaged.
    """
    network = load_network(network_folder)
    reads_grid = "grid" in network.settings.channels_read
    return NetworkForecaster(network, load_encoder(autoencoder_folder) if reads_grid else None, **choices)
