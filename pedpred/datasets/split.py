"""Split a data set into training and validation by whole scenes or whole tracks."""

from __future__ import annotations

import numpy as np

from pedpred.datasets.motion import MotionData
from pedpred.errors import ValueRuleError


def split_sequences(
    data: MotionData, by: str, validation_share: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Divide the sequences of a data set.

    Args:
        data: the data set.
        by: "scene" splits by arrangement, "track" by track (with all its phases); both with all variants of
            the scene.
        validation_share: share of the scenes or tracks that is kept for validation; at least one.
        rng: decides which.

    Returns:
        Rows [first, last) of the training and of the validation sequences. [S, 2] each

    Raises:
        ValueRuleError: `by` is unknown, or the data set has only one scene or track to divide.
    """
    if by not in ("scene", "track"):
        raise ValueRuleError("validation_by", by, "use 'scene' or 'track'")
    group = data.scene if by == "scene" else data.track
    names = rng.permutation(np.unique(group))
    held = max(1, round(validation_share * len(names)))
    if held >= len(names):
        rule = f"the data have {len(names)} of it: nothing is left to train on"
        raise ValueRuleError("validation_by", by, rule)
    validation = np.isin(group, names[:held])
    return data.sequences[~validation], data.sequences[validation]
