"""The occupancy crops of a data set, for the auto-encoder."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pedpred.errors import ConfigError
from pedpred.storage.shards import read_crops, read_manifest


def crops_of(
    features: Path, validation_share: float, validation_crops: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, int]:
    """Bit-packed crops, divided by arrangement.

    Args:
        features: folder of feature shards.
        validation_share: share of the arrangements kept for validation; at least one.
        validation_crops: at most this many crops of them, drawn at random.
        rng: decides which.

    Returns:
        Training crops [M, bytes], validation crops [V, bytes], and the cells per side of a crop.
    """
    settings, names = read_manifest(features)
    held = max(1, round(validation_share * len(names)))
    if held >= len(names):
        raise ConfigError(
            "autoencoder.validation_share", validation_share, f"{features} has {len(names)} scenes only"
        )
    order = [names[i] for i in rng.permutation(len(names))]
    parts = [np.concatenate(list(read_crops(features, name, settings))) for name in order]
    validation = np.concatenate(parts[:held])
    chosen = rng.permutation(len(validation))[:validation_crops]
    return np.concatenate(parts[held:]), validation[chosen], settings.grid_cells
