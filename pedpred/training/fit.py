"""One phase of the curriculum: rows and initial weights in, checkpoint and curve out."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from torch.optim.swa_utils import AveragedModel

from pedpred.datasets.rows import TrainingRows, load_rows
from pedpred.errors import InputError, ValueRuleError
from pedpred.files import atomic_write, translate_errors
from pedpred.models.contract import ForecastNetwork, NetworkSettings
from pedpred.models.lstm.encoding import EMBEDDED, encode, load_encoder
from pedpred.models.registry import describe_network, is_network
from pedpred.storage.checkpoints import load_weights, read_checkpoint
from pedpred.training.distributed import DistributedContext
from pedpred.training.learner import FitSettings
from pedpred.training.loop import train
from pedpred.training.progress import scratch_folder


def load_training_rows(
    architecture: NetworkSettings,
    folders: Mapping[str, Path],
    embeddings: Mapping[str, Path],
    autoencoder: Path,
) -> TrainingRows:
    """The rows that a network is trained on.

    Args:
        architecture: of the network.
        folders: set -> its rows.
        embeddings: set -> the frozen encoder's outputs there; read only if the network reads the grid.
        autoencoder: checkpoint of that encoder; likewise.
    """
    if EMBEDDED not in architecture.channels_read:
        return load_rows(folders)
    rows, encoder = load_rows(folders, embeddings), load_encoder(autoencoder)
    free = np.zeros((1, encoder.sides[0] ** 2 // 8), np.uint8)  # unmapped ground is free
    return replace(rows, empty={EMBEDDED: torch.from_numpy(encode(encoder, free)[0])})


def initialise(
    settings: NetworkSettings, rows: TrainingRows, previous: Path | None, seed: int
) -> ForecastNetwork:
    """A network with the weights of the phase before.

    Args:
        settings: of the network to build.
        rows: whose widths and horizon the network gets.
        previous: checkpoint of the same network, or of the auto-encoder, from which the network takes what it
            can (`ForecastNetwork.take_encoder`); None starts with random weights.
        seed: of all other weights.

    Raises:
        InputError: the checkpoint is missing, damaged or does not fit the settings.
    """
    torch.manual_seed(seed)
    network = settings.build(rows.widths, rows.horizon_steps)
    if previous is None:
        return network
    weights, about = read_checkpoint(previous)
    if is_network(about):
        load_weights(network, weights, previous)
        return network
    encoder = load_encoder(previous)
    remedy = "Train the auto-encoder with the sizes of the network"
    with translate_errors(partial(InputError, previous / "weights.safetensors", "weights", remedy=remedy)):
        network.take_encoder(encoder)
    return network


def fit(
    architecture: NetworkSettings,
    previous: Path | None,
    rows: TrainingRows,
    settings: FitSettings,
    title: str,
    context: DistributedContext,
) -> tuple[ForecastNetwork, pd.DataFrame, dict[str, Any]]:
    """Train a network.

    Args:
        architecture: settings of the network.
        previous: see `initialise`.
        rows: see `load_training_rows`.
        settings: of the training.
        title: of the progress bar.
        context: where to train.

    Returns:
        The network, the mean curve of the runs, and the checkpoint's description.

    Raises:
        InputError: the checkpoint is missing, damaged or does not fit.
        ValueRuleError: several runs have no weights to start from.
    """
    runs = settings.runs
    if runs > 1 and previous is None:
        raise ValueRuleError("runs", runs, "the mean of several needs weights to start from; use 1")
    digest = hashlib.sha256(rows.future.numpy().tobytes() + rows.future_steps.numpy().tobytes())
    about: dict[str, Any] = {"training": asdict(settings), "targets_sha256": digest.hexdigest()}
    resident, networks, curves = rows.to(context.device), [], []
    for seed in range(settings.seed, settings.seed + runs):
        network = initialise(architecture, rows, previous, seed)
        about = describe_network(network, rows.row_format) | about
        with scratch_folder(about | {"seed": seed}, network.state_dict(), context) as scratch:
            learner = replace(settings, seed=seed).learner(network.to(context.device), resident, context)
            named = title + (f", seed {seed}" if runs > 1 else "")
            curves.append(pd.DataFrame(train(learner, scratch, named)))
        networks.append(network)
    curve = pd.concat(curves).groupby(level=0).mean().astype(curves[0].dtypes)
    return networks[0] if runs == 1 else average_weights(networks), curve, about


def average_weights(networks: Sequence[ForecastNetwork]) -> ForecastNetwork:
    """A network with the mean of the weights of some."""
    mean = AveragedModel(networks[0])
    for network in networks:
        mean.update_parameters(network)
    assert isinstance(mean.module, ForecastNetwork)
    return mean.module


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
