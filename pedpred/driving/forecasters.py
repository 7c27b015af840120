"""The forecasters behind one interface: detections of an instant in, a forecast of the people out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from pedpred.driving.people import Crowd
from pedpred.online import OnlinePredictor
from pedpred.online.frame import Frame
from pedpred.online.past import slots_for
from pedpred.online.people import People, register_detections
from pedpred.scenes import Forecast, OccupancyMap, Predictions
from pedpred.tracking import Belief, predicted
from pedpred.tracking.tracks import TIME_TOLERANCE_S

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


class TrackedPeople:
    """People stand, or walk on at their tracked velocity; their tracks are those of the online predictor."""

    def __init__(self, predictor: OnlinePredictor, moving: bool, spread: bool):
        """Begin without people.

        Args:
            predictor: whose tracker, steps and settings are used.
            moving: whether they walk on.
            spread: whether the forecast has the covariance that the Kalman filter predicts.
        """
        self._bank, self._about = predictor.filters, predictor.description
        self._protocol, self._max_age_s = predictor.protocol, predictor.settings.max_age_s
        self._moving, self._spread = moving, spread
        self._people, self._lives = People.nobody({}, slots_for(0.0), len(self._bank.filters)), 0

    def update(self, time_s: float, track_id: np.ndarray, position: np.ndarray) -> Forecast:
        """See `Forecaster`."""
        frame = Frame.checked(time_s, track_id, position)
        people = self._people
        people = people.select(frame.time_s - people.seen_s <= self._protocol.lost_after_s)
        people = register_detections(people, frame, self._bank, self._about.standstill_mps, self._lives)
        self._people, self._lives = people, self._lives + len(frame.track_id)
        rows = np.flatnonzero(people.seen_s >= time_s - self._max_age_s - TIME_TOLERANCE_S)
        here, dt_s = people.at(rows, time_s), self._protocol.dt_s
        velocity = here.velocity if self._moving else np.zeros_like(here.velocity)
        ahead_s = (np.arange(self._protocol.horizon_steps) + 1) * dt_s
        path = here.position[:, None] + velocity[:, None] * ahead_s[:, None]
        covariance = self._covariance(rows, time_s, ahead_s) if self._spread else None
        pace = np.repeat(velocity[:, None], len(ahead_s), axis=1)
        return Forecast(time_s, here.track_id, pace, Predictions.single(path, dt_s, covariance))

    def _covariance(self, rows: np.ndarray, time_s: float, ahead_s: np.ndarray) -> np.ndarray:
        """Predicted by each filter and weighted by how well it fits, m^2. [R, P, 2, 2]."""
        held = {name: values[rows] for name, values in self._people.filters.items()}
        people, filters = held["weight"].shape
        share = np.exp(held["weight"])
        share /= share.sum(axis=1, keepdims=True)
        since_s = (time_s - self._people.seen_s[rows])[:, None, None] + ahead_s[:, None]
        since_s = np.broadcast_to(since_s, (people, len(ahead_s), filters)).ravel()
        q = np.tile(self._bank.acceleration_noise, people * len(ahead_s))
        each = (
            np.repeat(held[name][:, None], len(ahead_s), axis=1).reshape(-1, size)
            for name, size in (("position", 2), ("velocity", 2), ("covariance", 3))
        )
        variance = (
            predicted(Belief(*each), since_s, q).covariance[:, 0].reshape(people, len(ahead_s), filters)
        )
        return np.asarray((share[:, None] * variance).sum(axis=-1)[..., None, None] * np.eye(2))


class PointForecasts:
    """The one path that a predictor would give, without modes and covariances."""

    def __init__(self, predictor: OnlinePredictor):
        self._predictor = predictor

    def update(self, time_s: float, track_id: np.ndarray, position: np.ndarray) -> Forecast:
        """See `Forecaster`."""
        found = self._predictor.update(time_s, track_id, position)
        return replace(found, predictions=Predictions.single(found.position, found.dt_s))


class TrueFuture:
    """Where everybody really goes, seen or not: no forecaster can be better. It alone is given the future.

    People who react to the robot go there if it keeps its velocity.
    """

    def __init__(self, crowd: Crowd):
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
    "standing": lambda predictor: TrackedPeople(predictor, moving=False, spread=False),
    "constant_velocity": lambda predictor: TrackedPeople(predictor, moving=True, spread=False),
    "kalman": lambda predictor: TrackedPeople(predictor, moving=True, spread=True),
    "point": PointForecasts,
    "modes": lambda predictor: predictor,
}
"""Name -> forecaster that sees detections only, from a predictor without people."""

TRUTH = "true_future"
HARD = ("standing", "constant_velocity", "point", TRUTH)
"""Forecasts without covariances: people are somewhere for certain, and no limit of risk matters."""
NAMES = (*METHODS, TRUTH)


def forecaster_of(
    method: str, predictor: OnlinePredictor, occupancy: OccupancyMap, crowd: Crowd
) -> Forecaster:
    """Make a forecaster that has seen nobody yet.

    Args:
        method: one of `NAMES`.
        predictor: it is reset.
        occupancy: the walls.
        crowd: the people of the drive; only `TRUTH` gets them.
    """
    if method == TRUTH:
        return TrueFuture(crowd)
    predictor.reset()
    predictor.set_map(occupancy)
    return METHODS[method](predictor)
