"""A forecast of everybody present at one instant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.errors import ShapeError
from pedpred.scenes.predictions import Predictions


@dataclass(frozen=True)
class Forecast:
    """Predicted paths of everybody present at one instant, by track.

    Attributes:
        time_s: the instant, s; step p of the predictions is at time_s + (p + 1) dt_s.
        track_id: [N] int64, rising
        velocity: of the point forecast, world frame, m/s. [N, P, 2]
        predictions: world frame. N rows, P steps
    """

    time_s: float
    track_id: np.ndarray
    velocity: np.ndarray
    predictions: Predictions

    def __post_init__(self) -> None:
        shape = (len(self.track_id), self.predictions.steps, 2)
        if self.predictions.point.shape != shape:
            raise ShapeError("predictions", self.predictions.point.shape, str(shape))
        if self.velocity.shape != shape:
            raise ShapeError("velocity", self.velocity.shape, str(shape))

    def __len__(self) -> int:
        return len(self.track_id)

    @property
    def dt_s(self) -> float:
        """Time between two steps, s."""
        return self.predictions.dt_s

    @property
    def position(self) -> np.ndarray:
        """The point forecast, world frame, m. [N, P, 2]."""
        return self.predictions.point

    @property
    def covariance(self) -> np.ndarray | None:
        """Of the positions of the most likely mode, world frame, m^2. [N, P, 2, 2]."""
        covariance = self.predictions.covariance
        return None if covariance is None else covariance[:, 0]
