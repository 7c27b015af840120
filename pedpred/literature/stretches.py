"""The windows of most publications on the ETH and UCY recordings: 8 annotations seen, the next 12 forecast.

Windows are all stretches of 20 consecutive native annotations of one person, one per starting annotation.
Earlier annotations are not used.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pedpred.errors import ValueRuleError, shape_error
from pedpred.scenes import Trajectories

TOLERANCE_S = 1e-3
"""Two annotations follow each other if their distance in time differs from the step by less than this, s."""


@dataclass(frozen=True)
class Stretches:
    """Consecutive annotations, world frame. W windows, O observed and P following positions.

    Attributes:
        track: of each window. [W]
        end_s: time of the last observed annotation, s. [W]
        seen: observed positions, m. [W, O, 2]
        truth: the positions after them, m. [W, P, 2]
        step_s: between two annotations, s.
    """

    track: np.ndarray
    end_s: np.ndarray
    seen: np.ndarray
    truth: np.ndarray
    step_s: float

    def __post_init__(self) -> None:
        for part in fields(self):
            value = getattr(self, part.name)
            if part.name != "step_s" and len(value) != len(self.track):
                raise shape_error(part.name, value.shape, f"[{len(self.track)}, ...]")
        if not self.step_s > 0:
            raise ValueRuleError("step_s", self.step_s, "it must be positive")


def find_stretches(trajectories: Trajectories, observed: int, predicted: int, step_s: float) -> Stretches:
    """Find all full windows: no annotation between the first and the last one is missing."""
    order = np.lexsort((trajectories.time_s, trajectories.track_id))
    track, time_s = trajectories.track_id[order], trajectories.time_s[order]
    follows = (np.diff(track) == 0) & (np.abs(np.diff(time_s) - step_s) < TOLERANCE_S)
    length = observed + predicted
    if len(track) < length:
        first = np.zeros(0, dtype=np.int64)
    else:
        first = np.flatnonzero(sliding_window_view(follows, length - 1).all(axis=-1))
    paths = trajectories.position[order][first[:, None] + np.arange(length)]
    end_s = time_s[first + observed - 1]
    return Stretches(track[first], end_s, paths[:, :observed], paths[:, observed:], step_s)
