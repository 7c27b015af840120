"""The forecasters behind one interface: detections of an instant in, a forecast of the people out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from pedpred.driving.crowds import MovingCrowd
from pedpred.driving.intentions import SocialForces
from pedpred.driving.tracked import TrackedPeople
from pedpred.online import OnlinePredictor
from pedpred.scenes import Forecast, OccupancyMap, Predictions

_HORIZON_S = 3.0


class Forecaster(Protocol):
    """Anything that forecasts people from their detections, frame by frame."""

    def update(self, time_s: float, track_id: np.ndarray, position: np.ndarray) -> Forecast:
        """Take the detections of one instant, give everybody's forecast, in the world frame.

        Args:
            time_s: later than the last one, s.
            track_id: who is detected. [D]
            position: where, world frame, m. [D, 2]
        """
        ...  # pragma: no cover


class PresentMotion:
    """People stand, or walk on at their tracked velocity."""

    def __init__(self, predictor: OnlinePredictor, moving: bool, spread: bool):
        """Begin without people.

        Args:
            predictor: whose tracker, steps and settings are used.
            moving: whether they walk on.
            spread: whether the forecast has the covariance that the Kalman filter predicts.
        """
        self._people, self._protocol = TrackedPeople(predictor), predictor.protocol
        self._moving, self._spread = moving, spread

    def update(self, time_s: float, track_id: np.ndarray, position: np.ndarray) -> Forecast:
        """See `Forecaster`."""
        here, dt_s = self._people.follow(time_s, track_id, position), self._protocol.dt_s
        velocity = here.velocity if self._moving else np.zeros_like(here.velocity)
        ahead_s = self._protocol.ahead_s
        path = here.position[:, None] + velocity[:, None] * ahead_s[:, None]
        covariance = self._people.covariance(time_s, ahead_s) if self._spread else None
        pace = np.repeat(velocity[:, None], len(ahead_s), axis=1)
        return Forecast(time_s, here.track_id, pace, Predictions.single(path, dt_s, covariance))


class PointForecasts:
    """The one path that a predictor would give, without modes and covariances."""

    def __init__(self, predictor: OnlinePredictor):
        self._predictor = predictor

    def update(self, time_s: float, track_id: np.ndarray, position: np.ndarray) -> Forecast:
        """See `Forecaster`."""
        forecast = self._predictor.update(time_s, track_id, position)
        return replace(forecast, predictions=Predictions.single(forecast.position, forecast.dt_s))


class TrueFuture:
    """Where everybody really goes, seen or not: no forecaster can be better. It alone is given the future.

    People who react to the robot go there if it keeps its velocity.
    """

    def __init__(self, crowd: MovingCrowd):
        self._crowd = crowd

    def update(self, time_s: float, track_id: np.ndarray, position: np.ndarray) -> Forecast:
        """See `Forecaster`; the detections do not matter."""
        dt_s = self._crowd.dt_s
        path = self._crowd.ahead(round(_HORIZON_S / dt_s))
        who = np.isfinite(path[1:, :, 0]).any(axis=0)
        ahead = path[1:, who].transpose(1, 0, 2)
        pace = np.diff(path[:, who], axis=0).transpose(1, 0, 2) / dt_s
        return Forecast(time_s, self._crowd.track_id[who], pace, Predictions.single(ahead, dt_s))


METHODS: dict[str, Callable[[OnlinePredictor], Forecaster]] = {
    "standing": lambda predictor: PresentMotion(predictor, moving=False, spread=False),
    "constant_velocity": lambda predictor: PresentMotion(predictor, moving=True, spread=False),
    "kalman": lambda predictor: PresentMotion(predictor, moving=True, spread=True),
    "point": PointForecasts,
    "modes": lambda predictor: predictor,
}
"""Name -> forecaster that sees detections only, from a predictor without people."""

TRUTH = "true_future"
KNOWING: dict[str, Callable[[OnlinePredictor, MovingCrowd, OccupancyMap], Forecaster]] = {
    "social_force": SocialForces,
    TRUTH: lambda predictor, crowd, occupancy: TrueFuture(crowd),
}
"""Name -> forecaster that asks the people: for their goals, or, `TRUTH` alone, for the future."""

HARD = ("standing", "constant_velocity", "point", *KNOWING)
"""Forecasts without covariances: people are somewhere for certain, and no limit of risk matters."""
NAMES = (*METHODS, *KNOWING)


def forecaster_of(
    method: str, predictor: OnlinePredictor, occupancy: OccupancyMap, crowd: MovingCrowd
) -> Forecaster:
    """Make a forecaster that has seen nobody yet.

    Args:
        method: one of `NAMES`; any other name is that of a network which is compared with others.
        predictor: it is reset.
        occupancy: the walls.
        crowd: the people of the drive; only those of `KNOWING` get them.
    """
    predictor.reset()
    predictor.set_map(occupancy)
    if method in KNOWING:
        return KNOWING[method](predictor, crowd, occupancy)
    return METHODS.get(method, lambda network: network)(predictor)
