"""The occupancy crops of a data set, for training the auto-encoder and for distillation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pedpred.errors import ShapeError, ValueRuleError
from pedpred.features import FeatureSettings
from pedpred.simulation.fields import check_ranges
from pedpred.storage.mapped import MappedRows
from pedpred.storage.shards import read_crops, read_embeddings, read_manifest


@dataclass(frozen=True, kw_only=True)
class CropSplit:
    """How crops are divided for the auto-encoder.

    Attributes:
        validation_share: share of the arrangements kept for validation; at least one.
        validation_crops: at most this many crops of them, drawn at random.
    """

    validation_share: float
    validation_crops: int

    def __post_init__(self) -> None:
        check_ranges(self, {"validation_share": "[0, 1)", "validation_crops": "[1, 10000000]"})


@dataclass(frozen=True, kw_only=True)
class EmbeddedSplit:
    """How crops with embeddings are divided for the distillation.

    Attributes:
        validation_share: share of the arrangements kept for validation; at least one.
        every: take every n-th row; neighbouring rows are nearly the same.
    """

    validation_share: float
    every: int

    def __post_init__(self) -> None:
        check_ranges(self, {"validation_share": "[0, 1)", "every": "[1, 1000000]"})


def crops_of(features: Path, how: CropSplit, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, int]:
    """Bit-packed crops, divided by arrangement.

    Args:
        features: folder of feature shards.
        how: the division.
        rng: decides which.

    Returns:
        Training crops [M, bytes], which lie on disk (`MappedRows`), validation crops [V, bytes], and the
        cells per side of a crop.
    """
    settings, *halves = _divided(features, how.validation_share, rng)

    def mapped(shards: list[str]) -> np.ndarray:
        rows = MappedRows("occupancy")
        for name in shards:
            rows.extend(read_crops(features, name, settings))
        return rows.array()

    training, validation = map(mapped, halves)
    chosen = rng.permutation(len(validation))[: how.validation_crops]
    return training, validation[chosen], settings.grid_cells


@dataclass(frozen=True)
class EmbeddedCrops:
    """Crops and their embeddings by the frozen encoder.

    Attributes:
        packed: bit-packed crops. [M, cells^2 / 8] uint8
        embedding: [M, C] float16
        cells: per side of a crop.
    """

    packed: np.ndarray
    embedding: np.ndarray
    cells: int

    def __len__(self) -> int:
        return len(self.packed)


def embedded_crops_of(
    features: Path, embeddings: Path, how: EmbeddedSplit, rng: np.random.Generator
) -> tuple[EmbeddedCrops, EmbeddedCrops]:
    """Training and validation crops with their embeddings, divided by arrangement as in `crops_of`.

    Args:
        features: folder of feature shards.
        embeddings: folder of the encoder's outputs.
        how: the division.
        rng: decides which arrangements.

    Raises:
        StorageError: a file cannot be read.
        ValueRuleError: there are too few arrangements.
        ShapeError: features and embeddings do not belong together.
    """
    settings, *halves = _divided(features, how.validation_share, rng)

    def embedded(shards: list[str]) -> EmbeddedCrops:
        packed, embedding = MappedRows("occupancy"), MappedRows("embedding")
        for name in shards:
            packed.extend(_thinned(read_crops(features, name, settings), how.every))
            embedding.extend(_thinned(read_embeddings(embeddings, name), how.every))
            if len(embedding) != len(packed):
                raise ShapeError(f"embedding up to {name}", (len(embedding),), f"[{len(packed)}]")
        return EmbeddedCrops(packed.array(), embedding.array(), settings.grid_cells)

    training, validation = map(embedded, halves)
    return training, validation


def _thinned(blocks: Iterable[np.ndarray], every: int) -> Iterator[np.ndarray]:
    """Every n-th row, counted across all blocks."""
    seen = 0
    for block in blocks:
        yield block[-seen % every :: every]
        seen += len(block)


def _divided(
    features: Path, validation_share: float, rng: np.random.Generator
) -> tuple[FeatureSettings, list[str], list[str]]:
    """Sizes, and the shards for training and for validation in random order; variants of a scene together."""
    settings, shards = read_manifest(features)
    scenes = list(dict.fromkeys(shards.values()))
    held = max(1, round(validation_share * len(scenes)))
    if held >= len(scenes):
        raise ValueRuleError("validation_share", validation_share, f"{features} has {len(scenes)} scenes")
    order = [scenes[i] for i in rng.permutation(len(scenes))]
    training, validation = (
        [name for scene in half for name in shards if shards[name] == scene]
        for half in (order[held:], order[:held])
    )
    return settings, training, validation
