"""One phase of the curriculum: data and initial weights in, checkpoint and curve out."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from pedpred.datasets.motion import load_motion_data
from pedpred.datasets.split import split_sequences
from pedpred.files import atomic_write
from pedpred.networks import MotionLstm, MotionSettings
from pedpred.networks.encoding import encode, load_encoder
from pedpred.storage.checkpoints import load_weights, read_checkpoint, write_checkpoint
from pedpred.storage.shards import read_manifest
from pedpred.training.distributed import DistributedContext
from pedpred.training.recurrent import TrainingSettings, train_motion


def initialised(settings: MotionSettings, previous: Path, seed: int) -> MotionLstm:
    """A motion network with the weights of the phase before.

    Args:
        settings: the network to build.
        previous: checkpoint of a motion network, or of the auto-encoder, whose fully connected
            layer then becomes the grid channel's embedding (paper, III-B.2).
        seed: of the weights that nothing initialises.
    """
    torch.manual_seed(seed)
    network = MotionLstm(settings)
    weights, about = read_checkpoint(previous)
    if about["kind"] == "motion":
        load_weights(network, weights, previous)
    elif "grid" in settings.channels:
        layer = {k: weights[f"encoder.fc.{k}"] for k in ("weight", "bias")}
        load_weights(network.projections["grid"], layer, previous)
    return network


def fit(
    network: MotionLstm,
    features: Path,
    grid: tuple[Path, Path],
    split: tuple[str, float],
    settings: TrainingSettings,
    description: str,
    context: DistributedContext,
) -> tuple[pd.DataFrame, dict]:
    """Load a data set, divide it and train; leaves the best weights in `network`.

    Args:
        network: initialised.
        features: folder of feature shards.
        grid: folder of the frozen encoder's outputs and that of the auto-encoder; read only when the network
            has a grid channel.
        split: what is kept whole ("scene" or "track") and the share kept for validation.
        settings: see there.
        description: title of the progress bar.
        context: where to train; the network is moved there.

    Returns:
        The curve and the checkpoint's description.
    """
    embeddings, autoencoder = grid if "grid" in network.settings.channels else (None, None)
    data = load_motion_data(features, embeddings)
    if autoencoder is not None:
        data = replace(
            data, empty_embedding=empty_embedding(autoencoder, read_manifest(features)[0].grid_cells)
        )
    by, share = split
    training, validation = split_sequences(data, by, share, np.random.default_rng(settings.seed))
    about = {
        "kind": "motion",
        "network": network.settings.plain(),
        "dt_s": data.dt_s,
        "training": asdict(settings),
        "features_sha256": hashlib.sha256((features / "manifest.json").read_bytes()).hexdigest(),
    }
    scratch = Path("build/training") / _digest(network, about)
    network.to(context.device)
    resident = data.to(context.device)
    curve = train_motion(network, resident, training, validation, settings, scratch, description, context)
    if context.writes:
        shutil.rmtree(scratch, ignore_errors=True)
    return pd.DataFrame(curve), about


def empty_embedding(encoder: Path, cells: int) -> torch.Tensor:
    """What the frozen convolutions make of a crop without obstacles: unmapped ground is free. [C] float32.

    Args:
        encoder: checkpoint of the auto-encoder.
        cells: per side of a crop.
    """
    free = np.zeros((1, cells * cells // 8), np.uint8)
    return torch.from_numpy(encode(load_encoder(encoder), free, cells)[0])


def write_phase(network: MotionLstm, about: dict, curve: pd.DataFrame, out: Path, curve_path: Path) -> None:
    """Write checkpoint and curve of a finished phase."""
    write_checkpoint(out, network.state_dict(), about)
    write_curve(curve, curve_path)


def write_curve(curve: pd.DataFrame, path: Path) -> None:
    """Write a training curve as TSV, one row per validation."""
    with atomic_write(path) as new:
        curve.to_csv(new, sep="\t", index=False, float_format="%.5f")


def _digest(network: MotionLstm, about: dict) -> str:
    """Identifies a training by its configuration, data and initial weights."""
    digest = hashlib.sha256(json.dumps(about, sort_keys=True).encode())
    for tensor in network.state_dict().values():
        digest.update(tensor.numpy().tobytes())
    return digest.hexdigest()[:16]
