"""The convolutional auto-encoder of the occupancy crop (Pfeiffer et al. 2018, III-B.1)."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional as f

from pedpred.errors import InputError
from pedpred.files import translate_errors
from pedpred.storage.checkpoints import load_weights, read_checkpoint

_WIDTHS = (64, 32)
"""Channels behind the first and the second convolution."""
_EMBEDDING_CHANNELS = 8
_CONVOLUTIONS = ((5, 0), (3, 1), (3, 1))
"""(kernel size, padding) of the three convolutions; their stride is 2."""


class GridEncoder(nn.Module):
    """Crop -> embedding (convolutions, frozen after pre-training) -> latent (fully connected)."""

    def __init__(self, cells: int, latent: int = 64):
        """Make random weights.

        Args:
            cells: cells per side of a crop.
            latent: width of the latent features.
        """
        super().__init__()
        channels = (1, *_WIDTHS, _EMBEDDING_CHANNELS)
        layers = [
            nn.Conv2d(before, after, kernel_size=kernel, stride=2, padding=padding)
            for before, after, (kernel, padding) in zip(channels, channels[1:], _CONVOLUTIONS, strict=False)
        ]
        self.conv1, self.conv2, self.conv3 = layers
        self.sides = _sides(cells)
        self.fc = nn.Linear(_EMBEDDING_CHANNELS * self.sides[-1] ** 2, latent)

    def embedding(self, crops: Tensor) -> Tensor:
        """Convolve crops of 0 and 1. [N, cells, cells] -> [N, C]."""
        hidden = torch.relu(self.conv1(crops[:, None]))
        hidden = torch.relu(self.conv2(hidden))
        return torch.relu(self.conv3(hidden)).flatten(1)

    def forward(self, crops: Tensor) -> Tensor:
        """Latent features of crops. [N, cells, cells] -> [N, latent]."""
        return self.fc(self.embedding(crops))


class GridAutoencoder(nn.Module):
    """Encoder and a decoder that uses the encoder's own weights, transposed, with biases of its own.

    Untied, for comparison, the decoder has weights of its own.
    """

    def __init__(self, cells: int, latent: int = 64, tied: bool = True):
        super().__init__()
        self.encoder = GridEncoder(cells, latent)
        self.decoder = nn.ParameterDict({} if tied else _weights(GridEncoder(cells, latent)))
        self.embedding_bias = nn.Parameter(torch.zeros(self.encoder.fc.in_features))
        self.bias3 = nn.Parameter(torch.zeros(_WIDTHS[1]))
        self.bias2 = nn.Parameter(torch.zeros(_WIDTHS[0]))
        self.bias1 = nn.Parameter(torch.zeros(1))

    def forward(self, crops: Tensor) -> Tensor:
        """Reconstruct crops, linearly: a sigmoid would saturate at "all free". [N, cells, cells] both."""
        weights = _weights(self.encoder) | dict(self.decoder.items())
        embedding = torch.relu(f.linear(self.encoder(crops), weights["fc"].t(), self.embedding_bias))
        cells, outer, inner, innermost = self.encoder.sides
        hidden = embedding.unflatten(1, (_EMBEDDING_CHANNELS, innermost, innermost))
        hidden = torch.relu(_transposed(hidden, weights["conv3"], self.bias3, inner))
        hidden = torch.relu(_transposed(hidden, weights["conv2"], self.bias2, outer))
        return _transposed(hidden, weights["conv1"], self.bias1, cells).squeeze(1)


def read_autoencoder(folder: Path) -> GridAutoencoder:
    """A pre-trained auto-encoder.

    Raises:
        InputError: a file is missing, damaged or of another network.
    """
    weights, about = read_checkpoint(folder)
    tied = not any(name.startswith("decoder.") for name in weights)
    with translate_errors(
        partial(InputError, folder / "about.json", "settings", remedy="Train the auto-encoder again")
    ):
        network = GridAutoencoder(int(about["cells"]), about["settings"]["latent"], tied)
    load_weights(network, weights, folder)
    return network


def _weights(encoder: GridEncoder) -> dict[str, Tensor]:
    return {name: encoder.get_parameter(f"{name}.weight") for name, _ in encoder.named_children()}


def _sides(cells: int) -> list[int]:
    """Cells per side of a crop and after each convolution. [4]."""
    sides = [cells]
    for kernel, padding in _CONVOLUTIONS:
        sides.append((sides[-1] + 2 * padding - kernel) // 2 + 1)
    return sides


def _transposed(hidden: Tensor, weight: Tensor, bias: Tensor, side: int) -> Tensor:
    """Transpose of a stride-2 convolution with the same weights; side: cells per side of its output."""
    padding = dict(_CONVOLUTIONS)[weight.shape[-1]]  # equal kernel sizes have equal padding
    rest = side - (2 * (hidden.shape[-1] - 1) - 2 * padding + weight.shape[-1])
    return f.conv_transpose2d(hidden, weight, bias, stride=2, padding=padding, output_padding=rest)


def reconstruction_loss(crops: Tensor, reconstruction: Tensor) -> Tensor:
    """Sum of squared cell errors of a crop, averaged over crops (paper, eq. 4). [N, ...] x 2 -> []."""
    return (crops - reconstruction).square().sum(dim=(1, 2)).mean()


def intersection_over_union(crops: Tensor, reconstruction: Tensor) -> float:
    """Agreement of the occupied cells (value > 1/2) over all crops; 1 when both are empty."""
    truth, guess = crops > 0.5, reconstruction > 0.5
    union = (truth | guess).sum()
    return float((truth & guess).sum() / union) if union else 1.0
