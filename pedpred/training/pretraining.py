"""Pre-training of the grid encoder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch.nn.utils import clip_grad_norm_
from tqdm import tqdm

from pedpred.features import unpack_crops
from pedpred.networks.autoencoder import GridAutoencoder, intersection_over_union, reconstruction_loss
from pedpred.training.schedule import learning_rate

_CROPS_AT_ONCE = 8
"""The first layer's output of so many, 1.6 MB, stays in the cache and in memory that the allocator keeps."""


@dataclass(frozen=True)
class AutoencoderSettings:
    """How the auto-encoder is trained.

    Attributes:
        latent: width of the latent space.
        batch: crops per step.
        steps: optimiser steps.
        validate_every: steps between two validations.
        lr: peak learning rate (Adam).
        warmup_steps: steps of linear warm-up.
        clip_norm: largest gradient norm.
        seed: of the weights and of the order of the crops.
        tied: the decoder uses the encoder's weights.
    """

    latent: int
    batch: int
    steps: int
    validate_every: int
    lr: float
    warmup_steps: int
    clip_norm: float
    seed: int
    tied: bool = True


def train_autoencoder(
    training: np.ndarray, validation: np.ndarray, cells: int, settings: AutoencoderSettings
) -> tuple[GridAutoencoder, list[dict[str, float]]]:
    """Train on bit-packed crops.

    Args:
        training: [M, cells^2 / 8] uint8
        validation: crops of other arrangements. [V, cells^2 / 8] uint8
        cells: cells per side of a crop.
        settings: see there.

    Returns:
        The network, and its curve: one row per validation.
    """
    torch.manual_seed(settings.seed)
    rng = np.random.default_rng(settings.seed)
    network = GridAutoencoder(settings.latent, settings.tied)
    optimizer = torch.optim.Adam(network.parameters(), lr=settings.lr)
    untrained = {"epoch": 0, "step": 0, "train_loss": float("nan")}
    curve: list[dict[str, float]] = [untrained | validate(network, validation, cells)]
    losses: list[float] = []
    for step in tqdm(range(settings.steps), desc="auto-encoder", unit="step"):
        rows = np.sort(rng.integers(0, len(training), settings.batch))
        crops = torch.from_numpy(unpack_crops(training[rows], cells)).to(torch.float32)
        optimizer.param_groups[0]["lr"] = learning_rate(
            step, settings.steps, settings.lr, settings.warmup_steps
        )
        loss = reconstruction_loss(crops, network(crops))
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        clip_grad_norm_(network.parameters(), settings.clip_norm)
        optimizer.step()
        losses.append(loss.item())
        if (step + 1) % settings.validate_every == 0 or step + 1 == settings.steps:
            row = {"epoch": len(curve), "step": step + 1, "train_loss": float(np.mean(losses))}
            curve.append(row | validate(network, validation, cells))
            losses = []
    return network, curve


@torch.inference_mode()
def validate(network: GridAutoencoder, crops: np.ndarray, cells: int) -> dict[str, float]:
    """Loss and intersection over union of bit-packed crops. [V, cells^2 / 8] uint8."""
    parts = []
    for at in range(0, len(crops), _CROPS_AT_ONCE):
        truth = torch.from_numpy(unpack_crops(crops[at : at + _CROPS_AT_ONCE], cells)).to(torch.float32)
        parts.append((truth, network(truth)))
    truth, guess = (torch.cat(side) for side in zip(*parts, strict=True))
    return {
        "validation_loss": float(reconstruction_loss(truth, guess)),
        "validation_iou": intersection_over_union(truth, guess),
    }
