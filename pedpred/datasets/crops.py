"""The occupancy crops of a data set, for training the auto-encoder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.models.features import RowFormat
from pedpred.models.lstm.features import LstmFeatures
from pedpred.rows.files import read_crops, read_manifest
from pedpred.settings import In, Settings
from pedpred.storage.mapped import MappedRows


@dataclass(frozen=True, kw_only=True)
class CropSplit(Settings):
    """How crops are divided for the auto-encoder.

    Attributes:
        validation_share: share of the arrangements kept for validation; at least one.
        validation_crops: at most this many crops of them, drawn at random.
    """

    validation_share: Annotated[float, In("[0, 1)")]
    validation_crops: Annotated[int, In("[1, 10000000]")]


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
    row_format, *halves = _divided(features, how.validation_share, rng)
    assert isinstance(row_format.features, LstmFeatures)

    def mapped(shards: list[str]) -> np.ndarray:
        rows = MappedRows("occupancy")
        for name in shards:
            rows.extend(read_crops(features, name, row_format))
        return rows.array()

    training, validation = map(mapped, halves)
    chosen = rng.permutation(len(validation))[: how.validation_crops]
    return training, validation[chosen], row_format.features.grid_cells


def _divided(
    features: Path, validation_share: float, rng: np.random.Generator
) -> tuple[RowFormat, list[str], list[str]]:
    """What the shards were made with; those for training and for validation, variants of a scene together."""
    row_format, shards = read_manifest(features)
    scenes = list(dict.fromkeys(shards.values()))
    held = max(1, round(validation_share * len(scenes)))
    if held >= len(scenes):
        raise ValueRuleError("validation_share", validation_share, f"{features} has {len(scenes)} scenes")
    order = [scenes[i] for i in rng.permutation(len(scenes))]
    training, validation = (
        [name for scene in half for name in shards if shards[name] == scene]
        for half in (order[held:], order[:held])
    )
    return row_format, training, validation
