"""A trained network as a forecaster (`pedpred.forecasting.Forecaster`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from pedpred.features import ModelFeatures
from pedpred.forecasting import ForecastRequest
from pedpred.forecasting.blocks import forecast_blocks
from pedpred.forecasting.postprocessing import Postprocessing
from pedpred.forecasting.tensors import predictions_of
from pedpred.models.contract import ForecastNetwork, Tensors
from pedpred.models.lstm.autoencoder import GridEncoder
from pedpred.models.lstm.encoding import EMBEDDED, encode_once, load_encoder
from pedpred.models.registry import load_network
from pedpred.models.rolling import outputs_at_instants
from pedpred.scenes import Predictions
from pedpred.settings import Settings
from pedpred.tracking.tracks import TIME_TOLERANCE_S, last_rows


@dataclass(frozen=True, kw_only=True)
class ForecasterChoices(Settings):
    """What follows networks without memory, see `NetworkForecaster`; defaults: published figures."""

    together: bool = True
    learning: bool = True
    trust: bool = True
    local_errors: bool = True


@dataclass(frozen=True)
class NetworkForecaster:
    """Runs a network along the clock of a request, so that its memory builds up as on a robot.

    An instant between two steps is forecast from its own inputs and the memory of the last step. A network
    without memory forecasts everybody present, not only who is asked for, because people choose together.

    Attributes:
        network: trained.
        features: what it reads.
        encoder: the frozen convolutions; None for a network that does not read the grid.
        together: people choose their modes together, see `pedpred.forecasting.selection`.
        learning: regions learn from earlier forecasts, see `pedpred.forecasting.regions`.
        trust: trust beside straight lines is learned likewise, see `pedpred.forecasting.trust`.
        local_errors: of earlier forecasts nearby correct later ones, see `pedpred.forecasting.local_errors`.
    """

    network: ForecastNetwork
    features: ModelFeatures
    encoder: GridEncoder | None
    together: bool = True
    learning: bool = True
    trust: bool = False
    local_errors: bool = False

    def __call__(self, request: ForecastRequest) -> Predictions:
        """World-frame predictions of the request's rows.

        Raises:
            ValueRuleError: the request has no clock.
        """
        sizes = request.sizes
        if not len(request.asked):
            return Predictions.single(np.zeros((0, sizes.horizon_steps, 2)), sizes.dt_s)
        if not self.network.state_shapes:
            return self._without_memory(request)
        return self._with_memory(request)

    def _without_memory(self, request: ForecastRequest) -> Predictions:
        """Predictions of a network without memory."""

        def infer(row: np.ndarray, inputs: Mapping[str, np.ndarray]) -> Predictions:
            channels = self.features.channels(inputs)
            with torch.inference_mode():
                outputs, _ = self.network.step({n: torch.from_numpy(v) for n, v in channels.items()}, {})
            return self._decode(outputs, request.sizes.dt_s)

        postprocessing = Postprocessing(
            self.together, self.learning, request.detection_noise_m, self.trust, self.local_errors
        )
        which, parts = zip(*forecast_blocks(request, self.features, infer, postprocessing), strict=True)
        return Predictions.join(parts).select(np.argsort(np.concatenate(which)))

    def _decode(self, outputs: Tensors, dt_s: float) -> Predictions:
        """What outputs mean, agent frames."""
        with torch.inference_mode():
            decoded = self.network.decode(outputs, dt_s)
        return predictions_of({name: values.numpy() for name, values in decoded.items()}, dt_s)

    def _with_memory(self, request: ForecastRequest) -> Predictions:
        """Predictions of a recurrent network."""
        steps, asked = request.steps, request.asked
        latest = last_rows(steps.track_id, steps.time_s, asked.track_id, asked.time_s)
        first = latest - steps.step[latest]
        on_step = steps.time_s[latest] >= asked.time_s - TIME_TOLERANCE_S
        before = steps.step[latest] + ~on_step
        row = request.past.last_row(steps.track_id, steps.time_s)
        inputs = self._inputs(request, [(row, steps.time_s), (request.rows, asked.time_s)])
        outputs = outputs_at_instants(self.network, inputs[0], inputs[1], first, before, on_step)
        return self._decode(outputs, request.sizes.dt_s).in_world(asked.position, asked.heading_rad)

    def _inputs(
        self, request: ForecastRequest, instants: list[tuple[np.ndarray, np.ndarray]]
    ) -> list[Tensors]:
        """The network's inputs at some lists of rows and times."""
        stored = [request.inputs(self.features, row, time_s) for row, time_s in instants]
        channels = [self.features.channels(columns) for columns in stored]
        if self.encoder is not None:
            embedded = encode_once(self.encoder, np.concatenate([columns["occupancy"] for columns in stored]))
            parts = np.split(embedded, np.cumsum([len(row) for row, _ in instants])[:-1])
            for columns, part in zip(channels, parts, strict=True):
                columns[EMBEDDED] = part
        return [{name: torch.from_numpy(values) for name, values in columns.items()} for columns in channels]


def forecaster(network_folder: Path, autoencoder_folder: Path, **choices: bool) -> NetworkForecaster:
    """The forecaster of a checkpoint; the auto-encoder is read only if the network reads the grid.

    Args:
        network_folder: the checkpoint.
        autoencoder_folder: the checkpoint of the encoder.
        choices: fields of `ForecasterChoices`.

    Raises:
        InputError: a checkpoint is missing or damaged.
    """
    network, made_with = load_network(network_folder)
    encoder = load_encoder(autoencoder_folder) if EMBEDDED in network.settings.channels_read else None
    return NetworkForecaster(network, made_with.features, encoder, **choices)
