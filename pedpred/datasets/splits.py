"""Which tracks or worlds are learned from, and which are kept for validation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pedpred.datasets.rows import TrainingRows
from pedpred.errors import ValueRuleError
from pedpred.settings import In, OneOf, Settings


@dataclass(frozen=True, kw_only=True)
class SplitSettings(Settings):
    """How sequences are divided into those to learn from and those to choose the weights by.

    Attributes:
        validation_by: what the split keeps whole, "scene" or "track".
        validation_share: share of the data kept for validation; at least one scene or track.
    """

    validation_by: Annotated[str, OneOf(("scene", "track"))]
    validation_share: Annotated[float, In("[0, 1)")]


def split_sequences(
    data: TrainingRows, how: SplitSettings, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Divide the sequences of a data set.

    Args:
        data: the data set.
        how: by "scene" splits by arrangement, by "track" by track (with all its phases); both with all
            variants of the scene.
        rng: decides which.

    Returns:
        Rows [first, last) of the training and of the validation sequences. [S, 2] each

    Raises:
        ValueRuleError: the data set has only one scene or track to divide.
    """
    by = how.validation_by
    group = data.spans.scene if by == "scene" else data.spans.track
    names = rng.permutation(np.unique(group))
    held = max(1, round(how.validation_share * len(names)))
    if held >= len(names):
        rule = f"the data have {len(names)} of it: nothing is left to train on"
        raise ValueRuleError("validation_by", by, rule)
    validation = np.isin(group, names[:held])
    return data.spans.rows[~validation], data.spans.rows[validation]


def select_held_out(spans: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    """Which spans of a set are kept for validation; at least one stays for training. [S] bool."""
    chosen = np.zeros(len(spans), bool)
    chosen[rng.permutation(len(spans))[: min(round(share * len(spans)), len(spans) - 1)]] = True
    return chosen
