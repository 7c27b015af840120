"""Training and validation: whole scenes or whole tracks apart, never windows of one track."""

from __future__ import annotations

import numpy as np

from pedpred.datasets.motion import MotionData
from pedpred.errors import ConfigError


def split_sequences(
    data: MotionData, by: str, validation_share: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Divide the sequences of a data set.

    Args:
        data: the data set.
        by: "scene" keeps whole arrangements apart, "track" whole tracks (all their clocks); both in all
            variants of the scene.
        validation_share: share of the scenes or tracks that is kept for validation; at least one.
        rng: decides which.

    Returns:
        Rows [first, last) of the training and of the validation sequences. [S, 2] each

    Raises:
        ConfigError: `by` is unknown, or the data set has only one scene or track to divide.
    """
    if by not in ("scene", "track"):
        raise ConfigError("training.*.validation_by", by, "use 'scene' or 'track'")
    group = data.scene if by == "scene" else data.track
    names = rng.permutation(np.unique(group))
    held = max(1, round(validation_share * len(names)))
    if held >= len(names):
        raise ConfigError(
            "training.*.validation_by", by, f"only {len(names)} of it here: nothing is left to train on"
        )
    validation = np.isin(group, names[:held])
    return data.sequences[~validation], data.sequences[validation]
