"""What a robot's sensor sees: range, field of view, occlusion by walls and people, noise, misses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pedpred.models.mixture.features.beams import obstacle_distances
from pedpred.scenes import OccupancyMap
from pedpred.settings import In, Settings

_BEFORE_M = 0.2  # a ray ends so far in front of a person's middle: people stand beside walls


@dataclass(frozen=True)
class RobotSensor(Settings):
    """A sensor on the robot.

    Attributes:
        range_m: it sees so far.
        view_rad: its field of view, centred on the robot's heading.
        noise_m: standard deviation of a coordinate of a detection.
        missed: share of missing detections.
        body_m: radius of a person who hides others.
        occluded: whether walls and people hide what is behind them.
    """

    range_m: Annotated[float, In("(0, 1000]")] = 10.0
    view_rad: Annotated[float, In("(0, 6.2832]")] = 2 * math.pi
    noise_m: Annotated[float, In("[0, 10]")] = 0.03
    missed: Annotated[float, In("[0, 1)")] = 0.05
    body_m: Annotated[float, In("[0, 10]")] = 0.2
    occluded: bool = True


@dataclass(frozen=True)
class Faults:
    """The random numbers of an episode, the same whatever drives.

    Attributes:
        noise: standard normal. [T, N, 2]
        missed: uniform. [T, N]
    """

    noise: np.ndarray
    missed: np.ndarray

    @classmethod
    def draw(cls, ticks: int, people: int, rng: np.random.Generator) -> Faults:
        """Draw those of some people at some instants."""
        return cls(rng.standard_normal((ticks, people, 2)), rng.random((ticks, people)))


def visible(
    state: tuple[float, ...], position: np.ndarray, occupancy: OccupancyMap, sensor: RobotSensor
) -> np.ndarray:
    """Whether the middle of each person is seen from the robot. [N] bool.

    A wall hides whoever is behind it by more than 0.2 m, however small the cells of the map are.

    Args:
        state: of the robot: x, y, heading, ...
        position: of the people, world frame, m; NaN: not there. [N, 2]
        occupancy: the walls.
        sensor: range and field of view.
    """
    away = position - np.array(state[:2])
    distance = np.hypot(away[:, 0], away[:, 1])
    seen = distance <= sensor.range_m
    towards = np.arctan2(away[:, 1], away[:, 0])
    turned = towards - state[2]
    seen &= np.abs((turned + np.pi) % (2 * np.pi) - np.pi) <= 0.5 * sensor.view_rad + 1e-9
    rows = np.flatnonzero(seen)
    if not sensor.occluded or not len(rows):
        return seen
    eye = np.broadcast_to(np.array(state[:2]), (len(rows), 2))
    free_m = obstacle_distances(occupancy, eye, towards[rows], 1, float(distance[rows].max()))[:, 0]
    hidden = free_m < distance[rows] - _BEFORE_M
    there = np.isfinite(distance)
    unit = away[rows] / np.maximum(distance[rows], 1e-9)[:, None]
    along = unit @ away[there].T
    aside = np.abs(unit[:, :1] * away[there, 1] - unit[:, 1:] * away[there, 0])
    between = (along > 0) & (aside < sensor.body_m) & (distance[there] < distance[rows, None] - sensor.body_m)
    seen[rows] = ~(hidden | between.any(axis=1))
    return seen
