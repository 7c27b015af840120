"""Unpacking of occupancy crops, which store one bit per cell."""

from __future__ import annotations

import numpy as np


def unpack_crops(crops: np.ndarray, cells: int) -> np.ndarray:
    """Expand bits to cells, [Q, cells^2 / 8] uint8 -> [Q, cells (forward), cells (left)] uint8, 0 or 1."""
    return np.unpackbits(crops, axis=-1, bitorder="little").reshape(-1, cells, cells)
