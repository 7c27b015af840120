"""Small made-up worlds in which the laws of forecasts are tried."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pedpred.geometry import rotate
from pedpred.online.predictor import NO_MAP, OnlinePredictor
from pedpred.scenes import Forecast, OccupancyMap

RATES_HZ = (2.0, 2.5, 5.0, 10.0, 15.0)
SPEEDS_MPS = (0.3, 2.5)
CROWD = 8
"""People in a world of `crowded`."""
_APART_M = 60.0


@dataclass(frozen=True)
class Move:
    """A world as seen from elsewhere: mirrored at the x axis, then turned, then shifted.

    Attributes:
        turn_rad: a map can only be turned by whole quarters.
        shift_m: [2]
        mirrored: whether left and right are exchanged.
    """

    turn_rad: float = 0.0
    shift_m: tuple[float, float] = (0.0, 0.0)
    mirrored: bool = False

    def there(self, points: np.ndarray) -> np.ndarray:
        """Points [..., 2], m, after the move."""
        points = points * self._side
        return rotate(points, np.full(points.shape[:-1], self.turn_rad)) + np.array(self.shift_m)

    def back(self, points: np.ndarray) -> np.ndarray:
        """The inverse of `there`."""
        points = points - np.array(self.shift_m)
        return rotate(points, np.full(points.shape[:-1], -self.turn_rad)) * self._side

    @property
    def _side(self) -> np.ndarray:
        return np.array([1.0, -1.0 if self.mirrored else 1.0])

    def map_there(self, occupancy: OccupancyMap) -> OccupancyMap:
        """A map after the move."""
        blocks = occupancy.occupied[:, ::-1] if self.mirrored else occupancy.occupied
        size = occupancy.resolution_m * np.array(occupancy.occupied.shape)
        corner = self.there(occupancy.origin + np.array([[0.0], [1.0]]) * size).min(axis=0)
        quarters = round(self.turn_rad / (np.pi / 2))
        return OccupancyMap(np.rot90(blocks, quarters), corner, occupancy.resolution_m)

    def forecast_back(self, forecast: Forecast) -> Forecast:
        """A forecast after the move, as seen from before it; without covariances."""
        was = forecast.predictions
        paths = replace(was, point=self.back(was.point), path=self.back(was.path), covariance=None)
        return replace(forecast, predictions=paths)


@dataclass(frozen=True)
class World:
    """People who are all detected at the same instants.

    Attributes:
        time_s: instants, rising, s. [T]
        position: detections, world frame, m; NaN where a person is absent. [T, N, 2]
        track_id: different whole numbers. [N]
        occupancy: static obstacles.
    """

    time_s: np.ndarray
    position: np.ndarray
    track_id: np.ndarray
    occupancy: OccupancyMap

    def forecasts(self, folder: Path) -> Iterator[tuple[np.ndarray, np.ndarray, Forecast]]:
        """Replay the world through a model folder.

        Yields:
            After each frame: who is there, as columns [n]; how often each was detected up to then [n]; and
            the forecast, whose rows are these people, in this order.
        """
        robot = OnlinePredictor.load(folder)
        robot.set_map(self.occupancy)
        there = ~np.isnan(self.position[..., 0])
        detections, by_name = np.cumsum(there, axis=0), np.argsort(self.track_id)
        for k, now in enumerate(self.time_s):
            who = by_name[there[k, by_name]]
            yield who, detections[k, who], robot.update(float(now), self.track_id[who], self.position[k, who])

    def moved(self, move: Move) -> World:
        """The same world elsewhere."""
        return replace(self, position=move.there(self.position), occupancy=move.map_there(self.occupancy))


def straight_walkers(
    rng: np.random.Generator, people: int, seconds: float, rate_hz: float
) -> tuple[World, np.ndarray]:
    """People alone on free ground, born at different times in the first half, who walk straight.

    The first one is the slowest, the second one the fastest.

    Returns:
        The world, and the velocity of each person, m/s [N, 2].
    """
    heading, speed = rng.uniform(-np.pi, np.pi, people), rng.uniform(*SPEEDS_MPS, people)
    speed[:2] = SPEEDS_MPS[: len(speed)]
    velocity = speed[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    time_s = np.arange(0.0, seconds, 1.0 / rate_hz)
    apart_m = _APART_M + 2 * SPEEDS_MPS[1] * seconds
    start = apart_m * np.arange(people)[:, None] * np.array([1.0, 0.0]) + rng.uniform(-9, 9, (people, 2))
    position = start + time_s[:, None, None] * velocity
    born_s = rng.uniform(0.0, 0.5 * seconds, people)
    born_s[0] = 0.0
    position[time_s[:, None] < born_s] = np.nan
    return World(time_s, position, np.arange(people), NO_MAP), velocity


def standing_people(rng: np.random.Generator, people: int, noise_m: float, rate_hz: float) -> World:
    """People alone on free ground, whose detections are noisy, for ten seconds; columns are 60 m apart."""
    time_s = np.arange(0.0, 10.0, 1.0 / rate_hz)
    place = _APART_M * np.arange(people)[:, None] * np.array([1.0, 0.0])
    position = place + rng.normal(0.0, noise_m, (len(time_s), people, 2))
    return World(time_s, position, np.arange(people), NO_MAP)


def crowded(rng: np.random.Generator) -> World:
    """`CROWD` people among blocks, within 20 m; about a third of them stand, some of those exactly."""
    velocity = rng.normal(0.0, 0.8, (CROWD, 2)) * (rng.random((CROWD, 1)) > 0.3)
    sway = rng.normal(0.0, 0.02, (12, CROWD, 2)) * (rng.random((CROWD, 1)) > 0.2)
    time_s = np.arange(len(sway)) / rng.choice(RATES_HZ)
    position = rng.uniform(-4.0, 4.0, (CROWD, 2)) + time_s[:, None, None] * velocity + sway
    blocks = OccupancyMap(rng.random((60, 60)) < 0.02, np.array([-6.0, -6.0]), 0.2)
    return World(time_s, position, rng.permutation(1000)[:CROWD], blocks)
