"""Encode packed occupancy crops with the frozen convolutions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from pedpred.models.lstm.autoencoder import GridEncoder, read_autoencoder
from pedpred.models.lstm.features.grids import unpack_crops

EMBEDDED = "grid"
"""The channel that the frozen encoder computes from the crops."""

CROPS_AT_ONCE = 8
"""Their first layer's output, 1.6 MB, stays in the cache and in memory that the allocator keeps."""


def load_encoder(folder: Path) -> GridEncoder:
    """The encoder of a pre-trained auto-encoder; errors of `read_autoencoder`."""
    return read_autoencoder(folder).encoder


def float_crops(packed: np.ndarray, cells: int) -> torch.Tensor:
    """Bit-packed crops as networks read them. [N, cells^2 / 8] uint8 -> [N, cells, cells] float32."""
    return torch.from_numpy(unpack_crops(packed, cells)).to(torch.float32)


@torch.no_grad()
def encode(encoder: GridEncoder, packed: np.ndarray) -> np.ndarray:
    """The frozen convolutions' outputs of bit-packed crops, in cache-sized batches.

    Args:
        encoder: pre-trained.
        packed: [M, cells^2 / 8] uint8

    Returns:
        Embeddings. [M, C] float32
    """
    # In place: `fast` is `encoder`, not a copy.
    fast = encoder.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    # Filled, not collected: small pieces kept between the layers' large outputs make the heap grow.
    embeddings = np.empty((len(packed), encoder.fc.in_features), np.float32)
    for at in range(0, len(packed), CROPS_AT_ONCE):
        batch = slice(at, at + CROPS_AT_ONCE)
        embeddings[batch] = fast.embedding(float_crops(packed[batch], encoder.sides[0])).numpy()
    return embeddings


def encode_once(encoder: GridEncoder, packed: np.ndarray) -> np.ndarray:
    """`encode` with each of equal crops encoded once; without a map, all are the free one."""
    row = np.dtype((np.void, packed.shape[1]))  # compared as a whole, not byte by byte
    rows = np.ascontiguousarray(packed).view(row).ravel()
    _, first, index = np.unique(rows, return_index=True, return_inverse=True)
    return encode(encoder, packed[first])[index]
