"""The convolutional auto-encoder of the occupancy crop (Pfeiffer et al. 2018, III-B.1)."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional as f

from pedpred.errors import StorageError
from pedpred.files import translate_errors
from pedpred.storage.checkpoints import load_weights, read_checkpoint

WIDTHS = (64, 32)
"""Channels behind the first and the second convolution."""
EMBEDDING_SHAPE = (8, 7, 7)
EMBEDDING_WIDTH = 8 * 7 * 7
"""What the convolutions leave of a 60 x 60 crop: 7 x 7 cells of 8 channels."""


class GridEncoder(nn.Module):
    """Crop -> embedding (convolutions, frozen after pre-training) -> latent (fully connected)."""

    def __init__(self, latent: int = 64, widths: tuple[int, int] = WIDTHS):
        super().__init__()
        first, second = widths
        self.conv1 = nn.Conv2d(1, first, kernel_size=5, stride=2)
        self.conv2 = nn.Conv2d(first, second, kernel_size=3, stride=2, padding=1)
        self.conv3 = nn.Conv2d(second, 8, kernel_size=3, stride=2, padding=1)
        self.fc = nn.Linear(EMBEDDING_WIDTH, latent)

    def embedding(self, crops: Tensor) -> Tensor:
        """Convolve crops of 0 and 1. [N, 60, 60] -> [N, 392]."""
        hidden = torch.relu(self.conv1(crops[:, None]))
        hidden = torch.relu(self.conv2(hidden))
        return torch.relu(self.conv3(hidden)).flatten(1)

    def forward(self, crops: Tensor) -> Tensor:
        """Latent features of crops. [N, 60, 60] -> [N, latent]."""
        return self.fc(self.embedding(crops))


class GridAutoencoder(nn.Module):
    """Encoder and a decoder that uses the encoder's own weights, transposed, with biases of its own.

    Untied, for comparison, the decoder has weights of its own.
    """

    def __init__(self, latent: int = 64, tied: bool = True):
        super().__init__()
        self.encoder = GridEncoder(latent)
        self.decoder = nn.ParameterDict({} if tied else _weights(GridEncoder(latent)))
        self.embedding_bias = nn.Parameter(torch.zeros(EMBEDDING_WIDTH))
        self.bias3 = nn.Parameter(torch.zeros(32))
        self.bias2 = nn.Parameter(torch.zeros(64))
        self.bias1 = nn.Parameter(torch.zeros(1))

    def forward(self, crops: Tensor) -> Tensor:
        """Reconstruct crops, linearly: a sigmoid saturates at "all free" first. [N, 60, 60] both."""
        weights = _weights(self.encoder) | dict(self.decoder.items())
        embedding = torch.relu(f.linear(self.encoder(crops), weights["fc"].t(), self.embedding_bias))
        hidden = embedding.unflatten(1, EMBEDDING_SHAPE)
        hidden = torch.relu(_up(hidden, weights["conv3"], self.bias3, padding=1))
        hidden = torch.relu(_up(hidden, weights["conv2"], self.bias2, padding=1))
        return _up(hidden, weights["conv1"], self.bias1, padding=0).squeeze(1)


def read_autoencoder(folder: Path) -> tuple[GridAutoencoder, int]:
    """A pre-trained auto-encoder and the cells per side of its crops.

    Raises:
        StorageError: a file is missing, damaged or of another network.
    """
    weights, about = read_checkpoint(folder)
    tied = not any(name.startswith("decoder.") for name in weights)
    with translate_errors(
        partial(StorageError, folder / "about.json", "settings", remedy="Train it again (dvc repro)")
    ):
        network, cells = GridAutoencoder(about["settings"]["latent"], tied), int(about["cells"])
    load_weights(network, weights, folder)
    return network, cells


def _weights(encoder: GridEncoder) -> dict[str, Tensor]:
    return {name: encoder.get_parameter(f"{name}.weight") for name, _ in encoder.named_children()}


def _up(hidden: Tensor, weight: Tensor, bias: Tensor, padding: int) -> Tensor:
    """Transpose of a stride-2 convolution with the same weights; doubles the side."""
    return f.conv_transpose2d(hidden, weight, bias, stride=2, padding=padding, output_padding=1)


def reconstruction_loss(crops: Tensor, reconstruction: Tensor) -> Tensor:
    """Sum of squared cell errors of a crop, averaged over crops (paper, eq. 4). [N, 60, 60] x 2 -> []."""
    return (crops - reconstruction).square().sum(dim=(1, 2)).mean()


def intersection_over_union(crops: Tensor, reconstruction: Tensor) -> float:
    """Agreement of the occupied cells (value > 1/2) over all crops; 1 when both are empty."""
    truth, guess = crops > 0.5, reconstruction > 0.5
    union = (truth | guess).sum()
    return float((truth & guess).sum() / union) if union else 1.0
