"""A transform between two frames that do not move."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pedpred.arrays import real_number, real_numbers
from pedpred.errors import ValueRuleError
from pedpred.geometry import rotate
from pedpred.scenes import Trajectories, rule_of


@dataclass(frozen=True)
class Transform:
    """Pose of the people's frame in the map's frame.

    Attributes:
        x_m: of its origin, m.
        y_m: m.
        yaw_rad: direction of its x axis, counter-clockwise from the map's x axis.
    """

    x_m: float
    y_m: float
    yaw_rad: float

    def __post_init__(self) -> None:
        for field, value in vars(self).items():
            rule, valid = rule_of("position", np.asarray(real_number(field, value)))
            if not valid:
                raise ValueRuleError(field, value, rule)
        if abs(self.yaw_rad) > 4.0 * math.pi:
            raise ValueRuleError("yaw_rad", self.yaw_rad, "it must be at most two turns: is it in degrees?")

    def to_map(self, position: np.ndarray) -> np.ndarray:
        """Points of the people's frame in the map's frame, m. [..., 2]."""
        points = real_numbers("position", position).astype(np.float64)
        return self._turned(points) + np.array([self.x_m, self.y_m])

    def moved(self, people: Trajectories) -> Trajectories:
        """People in the people's frame, in the map's frame."""
        turned = {} if people.velocity is None else {"velocity": self._turned(people.velocity)}
        goals = {} if people.goal is None else {"goal": self.to_map(people.goal)}
        return replace(people, position=self.to_map(people.position), **turned, **goals)

    def _turned(self, vectors: np.ndarray) -> np.ndarray:
        return rotate(vectors, np.full(vectors.shape[:-1], self.yaw_rad))
