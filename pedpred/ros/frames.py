"""Coordinate frames: where one lies in another, and whether people and map share one."""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import dataclass, replace

import numpy as np

from pedpred.arrays import real_number, real_numbers
from pedpred.errors import ValueRuleError
from pedpred.geometry import rotate
from pedpred.scenes import Trajectories, rule_of

TWO_TURNS_RAD = 4.0 * math.pi


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
        if abs(self.yaw_rad) > TWO_TURNS_RAD:
            raise ValueRuleError("yaw_rad", self.yaw_rad, "it must be at most two turns: is it in degrees?")

    def to_map(self, position: np.ndarray) -> np.ndarray:
        """Points of the people's frame in the map's frame, m. [..., 2]."""
        points = real_numbers("position", position).astype(np.float64)
        return self._turned(points) + np.array([self.x_m, self.y_m])

    def moved(self, people: Trajectories) -> Trajectories:
        """People seen in the people's frame, as seen in the map's."""
        turned = {} if people.velocity is None else {"velocity": self._turned(people.velocity)}
        goals = {} if people.goal is None else {"goal": self.to_map(people.goal)}
        return replace(people, position=self.to_map(people.position), **turned, **goals)

    def _turned(self, vectors: np.ndarray) -> np.ndarray:
        return rotate(vectors, np.full(vectors.shape[:-1], self.yaw_rad))


def check_frames(people: Set[str], grid: str | None, transform: Transform | None) -> None:
    """Check that people and map are in one frame, or that it is known how the frames lie.

    Args:
        people: the frames that people are in.
        grid: the frame of the map; None without a map.
        transform: of the people's frame in the map's.

    Raises:
        ValueRuleError: people are in several frames, or in another one than the map.
    """
    names = {name.lstrip("/") for name in people}
    if len(names) > 1:
        raise ValueRuleError("frame_id", sorted(names), "people must be in one frame: record them in one")
    if transform is None and grid is not None and names and names != {grid.lstrip("/")}:
        frames = f"people in {names.pop()!r}, map in {grid!r}"
        pose = "the pose of the people's frame in the map's, x, y and yaw (--transform)"
        rule = f"both must be in one frame: record /tf that leads from one to the other, or give {pose}"
        raise ValueRuleError("frame_id", frames, rule)
