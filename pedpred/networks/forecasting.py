"""A trained network as a forecaster of whole feature tables."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import torch

from pedpred.datasets.motion import MotionData, network_columns, sequences_of
from pedpred.errors import StorageError
from pedpred.features import FeatureSettings, FeatureTable
from pedpred.files import translate_errors
from pedpred.networks.gaussian import covariance_of
from pedpred.networks.lstm import MotionLstm, MotionSettings
from pedpred.networks.rolling import roll
from pedpred.storage.checkpoints import load_weights, read_checkpoint


def load_motion_lstm(folder: Path) -> MotionLstm:
    """The network of a checkpoint, ready to forecast.

    Raises:
        StorageError: the checkpoint is missing or damaged.
    """
    weights, about = read_checkpoint(folder)
    path = folder / "about.json"
    with translate_errors(partial(StorageError, path, "network", remedy="Train it again (dvc repro)")):
        settings = MotionSettings.parse(about["network"])
        with torch.device("meta"):  # no memory until the weights are known to fit
            network = MotionLstm(settings)
    load_weights(network, weights, folder)
    return network.eval()


def forecast_motion(
    network: MotionLstm, table: FeatureTable, embeddings: np.ndarray, settings: FeatureSettings
) -> tuple[np.ndarray, np.ndarray | None]:
    """Forecast at every row of one scene's feature table, in agent frames.

    Args:
        network: trained.
        table: the whole table, so that memory builds up as it would on a robot.
        embeddings: the frozen encoder's outputs of its crops, not rounded. [M, C] float32
        settings: the sizes that the table was made with.

    Returns:
        Velocities, m/s. [M, P, 2]
        Covariance of the position at the end of each step, m^2; None if the network tells none. [M, P, 2, 2]
    """
    spans = sequences_of(table)
    data = MotionData(
        **{name: torch.from_numpy(column) for name, column in network_columns(table, settings).items()},
        embedding=torch.from_numpy(embeddings.copy()),
        sequences=spans,
        scene=np.zeros(len(spans), dtype=np.int64),
        track=table.track_id[spans[:, 0]],
        dt_s=settings.dt_s,
    )
    motion = roll(network, data, spans)
    covariance = None if motion.spread is None else covariance_of(motion.spread).numpy()
    return motion.velocities.numpy(), covariance
