"""Where people will be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.errors import ShapeError


@dataclass(frozen=True)
class Forecast:
    """Predicted paths of everybody who is there at one instant, by track.

    Attributes:
        time_s: the instant, s.
        dt_s: time between two steps, s; step p is at time_s + (p + 1) dt_s.
        track_id: [N] int64, rising
        position: predicted, world frame, m. [N, P, 2]
        velocity: predicted, world frame, m/s. [N, P, 2]
        covariance: of the positions, world frame, m^2; None from a model that tells none. [N, P, 2, 2]
    """

    time_s: float
    dt_s: float
    track_id: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    covariance: np.ndarray | None = None

    def __post_init__(self) -> None:
        rows = len(self.track_id)
        for name in ("position", "velocity"):
            shape = getattr(self, name).shape
            if len(shape) != 3 or shape[0] != rows or shape[2] != 2:
                raise ShapeError(name, shape, f"({rows}, P, 2)")
        if self.covariance is not None and self.covariance.shape != (*self.position.shape, 2):
            raise ShapeError("covariance", self.covariance.shape, f"{(*self.position.shape, 2)}")

    def __len__(self) -> int:
        return len(self.track_id)
