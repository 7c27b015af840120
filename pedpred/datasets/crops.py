"""The occupancy crops of a data set, for the auto-encoder and for what learns from it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pedpred.errors import ConfigError, ShapeError
from pedpred.features import FeatureSettings
from pedpred.storage.shards import read_codes, read_crops, read_manifest


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
    settings, order, held = _divided(features, validation_share, rng)
    parts = [np.concatenate(list(read_crops(features, name, settings))) for name in order]
    validation = np.concatenate(parts[:held])
    chosen = rng.permutation(len(validation))[:validation_crops]
    return np.concatenate(parts[held:]), validation[chosen], settings.grid_cells


@dataclass(frozen=True)
class CodedCrops:
    """Crops and what the frozen encoder makes of them.

    Attributes:
        packed: bit-packed crops. [M, cells^2 / 8] uint8
        code: [M, C] float16
        cells: per side of a crop.
    """

    packed: np.ndarray
    code: np.ndarray
    cells: int

    def __post_init__(self) -> None:
        if len(self.packed) != len(self.code):
            raise ShapeError("code", self.code.shape, f"[{len(self.packed)}, C]")

    def __len__(self) -> int:
        return len(self.packed)


def coded_crops_of(
    features: Path, codes: Path, validation_share: float, every: int, rng: np.random.Generator
) -> tuple[CodedCrops, CodedCrops]:
    """Training and validation crops with their codes, divided by arrangement as in `crops_of`.

    Args:
        features: folder of feature shards.
        codes: folder of the encoder's outputs.
        validation_share: share of the arrangements kept for validation; at least one.
        every: only each so manieth row is taken; neighbouring rows show nearly the same.
        rng: decides which arrangements.

    Raises:
        StorageError: a file cannot be read.
        ShapeError: features and codes do not belong together.
    """
    settings, order, held = _divided(features, validation_share, rng)
    parts = [
        CodedCrops(
            np.concatenate(list(read_crops(features, name, settings)))[::every].copy(),
            read_codes(codes, name)[::every].copy(),
            settings.grid_cells,
        )
        for name in order
    ]

    def joined(some: list[CodedCrops]) -> CodedCrops:
        packed, code = (np.concatenate([getattr(p, k) for p in some]) for k in ("packed", "code"))
        return CodedCrops(packed, code, settings.grid_cells)

    return joined(parts[held:]), joined(parts[:held])


def _divided(
    features: Path, validation_share: float, rng: np.random.Generator
) -> tuple[FeatureSettings, list[str], int]:
    """Sizes, the scenes in random order, and how many of the first ones are for validation."""
    settings, names = read_manifest(features)
    held = max(1, round(validation_share * len(names)))
    if held >= len(names):
        raise ConfigError("validation_share", validation_share, f"{features} has {len(names)} scenes only")
    return settings, [names[i] for i in rng.permutation(len(names))], held
