"""One phase of the curriculum: data and initial weights in, checkpoint and curve out."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from pedpred.datasets.lanes import SplitSettings, split_sequences
from pedpred.datasets.motion import MotionData, load_motion_data
from pedpred.errors import StorageError
from pedpred.files import atomic_write, translate_errors
from pedpred.networks.contract import NetworkSettings, RecurrentNetwork
from pedpred.networks.encoding import encode, load_encoder
from pedpred.networks.registry import describe_network, is_network
from pedpred.storage.checkpoints import load_weights, read_checkpoint
from pedpred.storage.shards import read_manifest
from pedpred.training.distributed import DistributedContext
from pedpred.training.loop import scratch_folder, train
from pedpred.training.recurrent import RecurrentLearner, TrainingSettings


@dataclass(frozen=True)
class PhaseData:
    """Where a phase finds its data.

    Attributes:
        features: folders of feature shards, one per place or set of scenes.
        embeddings: the folder of the frozen encoder's outputs that belongs to each of them; read only if the
            network reads the grid.
        autoencoder: checkpoint of that encoder; likewise.
        split: into training and validation.
    """

    features: Sequence[Path]
    embeddings: Sequence[Path]
    autoencoder: Path
    split: SplitSettings

    def load(self, with_grid: bool) -> MotionData:
        """All rows, with the encoder's outputs and those of an empty crop for a network that reads them."""
        if not with_grid:
            return load_motion_data(self.features)
        cells = read_manifest(self.features[0])[0].grid_cells
        data = load_motion_data(self.features, self.embeddings)
        free = np.zeros((1, cells * cells // 8), np.uint8)  # unmapped ground is free
        empty = encode(load_encoder(self.autoencoder), free, cells)[0]
        return replace(data, empty_embedding=torch.from_numpy(empty))


def initialised(settings: NetworkSettings, data: MotionData, previous: Path, seed: int) -> RecurrentNetwork:
    """A network with the weights of the phase before.

    Args:
        settings: of the network to build.
        data: whose widths and horizon the network gets.
        previous: checkpoint of the same network, or of the auto-encoder, from which the network takes what it
            can (`RecurrentNetwork.take_encoder`).
        seed: of all other weights.

    Raises:
        StorageError: the checkpoint is missing, damaged or does not fit the settings.
    """
    weights, about = read_checkpoint(previous)
    torch.manual_seed(seed)
    network = settings.build(data.widths, data.horizon_steps)
    if is_network(about):
        load_weights(network, weights, previous)
        return network
    encoder = load_encoder(previous)
    remedy = "Train the auto-encoder with the sizes of the network"
    with translate_errors(partial(StorageError, previous / "weights.safetensors", "weights", remedy=remedy)):
        network.take_encoder(encoder)
    return network


def fit(
    network_settings: NetworkSettings,
    previous: Path,
    phase: PhaseData,
    settings: TrainingSettings,
    description: str,
    context: DistributedContext,
) -> tuple[RecurrentNetwork, pd.DataFrame, dict]:
    """Load the data, divide them and train.

    Args:
        network_settings: of the network.
        previous: see `initialised`.
        phase: the data.
        settings: see there.
        description: title of the progress bar.
        context: where to train.

    Returns:
        The network with the best weights, the curve, and the checkpoint's description.
    """
    data = phase.load("grid" in network_settings.channels_read)
    network = initialised(network_settings, data, previous, settings.seed)
    rng = np.random.default_rng(settings.seed)
    training, validation = split_sequences(data, phase.split, rng)
    about = {
        **describe_network(network),
        "dt_s": data.dt_s,
        "training": asdict(settings),
        "features_sha256": manifests_sha256(phase.features),
    }
    with scratch_folder(about, network.state_dict(), context) as scratch:
        network.to(context.device)
        resident = data.to(context.device)
        learner = RecurrentLearner(network, resident, training, validation, settings, context)
        curve = train(learner, scratch, description)
    return network, pd.DataFrame(curve), about


def manifests_sha256(features: Iterable[Path]) -> str:
    """Checksum of the manifests of feature folders, which identify their content."""
    digest = hashlib.sha256()
    for folder in features:
        digest.update((folder / "manifest.json").read_bytes())
    return digest.hexdigest()


def copy_phase(previous: Path, out: Path, curve_path: Path) -> None:
    """A phase without data: the checkpoint before it, unchanged, and a curve without rows."""
    for name in ("weights.safetensors", "about.json"):
        with atomic_write(out / name) as new:
            new.write_bytes((previous / name).read_bytes())
    write_curve(pd.DataFrame(columns=["epoch", "step", "train_loss"]), curve_path)


def write_curve(curve: pd.DataFrame, path: Path) -> None:
    """Write a training curve as TSV, one row per validation."""
    with atomic_write(path) as new:
        curve.to_csv(new, sep="\t", index=False, float_format="%.5f")
