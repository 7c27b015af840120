"""People as the online predictor tracks them, for forecasters without a network."""

from __future__ import annotations

import numpy as np

from pedpred.features import Pedestrians
from pedpred.online import OnlinePredictor
from pedpred.online.frame import Frame
from pedpred.online.past import slots_for
from pedpred.online.people import People
from pedpred.online.registration import register_detections
from pedpred.tracking import Belief, predict
from pedpred.tracking.tracks import TIME_TOLERANCE_S


class TrackedPeople:
    """Who is there, and how they move; the tracks are those of the online predictor."""

    def __init__(self, predictor: OnlinePredictor):
        """Begin without people; `predictor`: whose tracker and settings are used."""
        self._bank, self._about = predictor.filters, predictor.description
        self._protocol, self._max_age_s = predictor.protocol, predictor.settings.max_age_s
        self._people, self._lives = People.nobody({}, slots_for(0.0), len(self._bank.filters)), 0
        self._rows = np.zeros(0, np.int64)

    def follow(self, time_s: float, track_id: np.ndarray, position: np.ndarray) -> Pedestrians:
        """Take the detections of one instant, give everybody who is there then.

        Args:
            time_s: later than the last one, s.
            track_id: who is detected. [D]
            position: where, world frame, m. [D, 2]
        """
        frame = Frame.checked(time_s, track_id, position)
        people = self._people
        longest_s = self._protocol.lost_after_s + TIME_TOLERANCE_S
        people = people.select(frame.time_s - people.seen_s <= longest_s)
        people = register_detections(people, frame, self._bank, self._about.standstill_mps, self._lives)
        self._people, self._lives = people, self._lives + len(frame.track_id)
        self._rows = np.flatnonzero(people.seen_s >= time_s - self._max_age_s - TIME_TOLERANCE_S)
        return people.at(self._rows, time_s)

    def covariance(self, time_s: float, ahead_s: np.ndarray) -> np.ndarray:
        """Of the positions of those who are there, predicted by each filter and weighted by its fit.

        Args:
            time_s: of the last `follow`, s.
            ahead_s: times after it, s. [P]

        Returns:
            World frame, m^2. [R, P, 2, 2]
        """
        rows = self._rows
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
        variance = predict(Belief(*each), since_s, q).covariance[:, 0].reshape(people, len(ahead_s), filters)
        return np.asarray((share[:, None] * variance).sum(axis=-1)[..., None, None] * np.eye(2))
