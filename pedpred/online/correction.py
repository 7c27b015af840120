"""The world frame is corrected: a robot finds that it, and all that it saw, is elsewhere on its map."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pedpred.arrays import real_number, real_numbers
from pedpred.errors import ValueRuleError, shape_error
from pedpred.forecasting.local_errors import LocalErrors
from pedpred.forecasting.postprocessing import PlaceKnowledge
from pedpred.forecasting.regions import Regions
from pedpred.forecasting.trust import Trust
from pedpred.geometry import rotate, rotated_covariance
from pedpred.online.people import People
from pedpred.scenes import rule_of


@dataclass(frozen=True)
class Correction:
    """What was at p in the world frame is now at p, turned about the origin, plus a shift.

    Attributes:
        turn_rad: counter-clockwise, rad.
        shift: m. [2]
    """

    turn_rad: float
    shift: np.ndarray

    @classmethod
    def checked(cls, turn_rad: Any, shift: Any) -> Correction:
        """Convert the arguments.

        Raises:
            ValueRuleError: something is not a number or out of range, or of another shape.
        """
        turn, moved = real_number("turn_rad", turn_rad), real_numbers("shift", shift)
        if moved.shape != (2,):
            raise shape_error("shift", moved.shape, "(2,)")
        for name, value in (("turn_rad", np.asarray(turn)), ("shift", moved)):
            rule, valid = rule_of("position", value)
            if not valid.all():
                raise ValueRuleError(name, value.tolist(), rule)
        return cls(turn, moved.astype(np.float64))

    def of_people(self, people: People) -> People:
        """People, as they are now; what a filter says of its errors has no direction."""
        past, filters = people.past, people.filters
        trail = {"trail": self._places(past["trail"]), "last_velocity": self._vectors(past["last_velocity"])}
        states = {
            "position": self._places(filters["position"]),
            "velocity": self._vectors(filters["velocity"]),
        }
        return replace(
            people,
            detection=self._places(people.detection),
            position=self._places(people.position),
            velocity=self._vectors(people.velocity),
            heading_rad=np.angle(np.exp(1j * (people.heading_rad + self.turn_rad))),
            velocity_drift=self._vectors(people.velocity_drift),
            past=past | trail,
            filters=filters | states,
        )

    def of_place(self, place: PlaceKnowledge) -> PlaceKnowledge:
        """What was learned, and the forecasts and detections to learn from, as they are now."""
        return replace(
            place,
            trust=place.trust and self._of_trust(place.trust),
            regions=place.regions and self._of_regions(place.regions),
            local_errors=place.local_errors and self._of_errors(place.local_errors),
            detections=replace(place.detections, position=self._places(place.detections.position)),
        )

    def _of_trust(self, trust: Trust) -> Trust:
        past = tuple(
            one._replace(point=self._places(one.point), offset=self._vectors(one.offset))
            for one in trust.past
        )
        return replace(trust, past=past)

    def _of_regions(self, regions: Regions) -> Regions:
        pending = tuple(
            one._replace(path=self._places(one.path), covariance=self._covariances(one.covariance))
            for one in regions.pending
        )
        return replace(regions, pending=pending)

    def _of_errors(self, errors: LocalErrors) -> LocalErrors:
        means = errors.means._replace(
            start=self._places(errors.means.start),
            way=self._vectors(errors.means.way),
            error=self._vectors(errors.means.error),
        )
        past = tuple(
            one._replace(start=self._places(one.start), point=self._places(one.point)) for one in errors.past
        )
        waiting = errors.waiting._replace(
            start=self._places(errors.waiting.start),
            way=self._vectors(errors.waiting.way),
            error=self._vectors(errors.waiting.error),
        )
        return LocalErrors(means, waiting, past)

    def _vectors(self, vectors: np.ndarray) -> np.ndarray:
        return rotate(vectors, np.float64(self.turn_rad))

    def _places(self, places: np.ndarray) -> np.ndarray:
        return self._vectors(places) + self.shift

    def _covariances(self, covariance: np.ndarray) -> np.ndarray:
        return rotated_covariance(covariance, np.full(len(covariance), self.turn_rad))
