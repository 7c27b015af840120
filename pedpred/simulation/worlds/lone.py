"""People far from each other, on free ground, who walk exactly straight or stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.fields import Range
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.simulation.worlds.drawing import check_intervals

_FAR_M = 500.0  # between two people


@dataclass(frozen=True)
class LoneSettings:
    """Ranges of people far from each other.

    Attributes:
        duration_s: recorded time.
        people: their number.
        standing_share: share of those who stand.
        speed_mps: of the others; log-uniform, since slow people are the hardest to tell from standing ones.
    """

    duration_s: float
    people: int
    standing_share: float
    speed_mps: Range

    def __post_init__(self) -> None:
        check_intervals(self, {"(0, 36000]": "duration_s", "[1, 1000]": "people", "(0, 1000]": "speed_mps"})


def simulate_lone_people(
    settings: LoneSettings, record_s: float, name: str, rng: np.random.Generator
) -> Scene:
    """Simulate people far from each other who walk at constant velocities, or stand."""
    count, records = settings.people, round(settings.duration_s / record_s)
    stands = rng.random(count) < settings.standing_share
    slowest, fastest = np.log(settings.speed_mps)
    speed = np.exp(rng.uniform(slowest, fastest, count)) * ~stands
    angle = rng.uniform(0.0, 2 * np.pi, count)
    velocity = np.stack([np.cos(angle), np.sin(angle)], axis=1) * speed[:, None]
    time_s, person = np.repeat(np.arange(records) * record_s, count), np.tile(np.arange(count), records)
    start = np.stack([np.arange(count) * _FAR_M, np.zeros(count)], axis=1)
    trajectories = Trajectories(
        time_s=np.round(time_s, 9),
        track_id=person,
        position=start[person] + velocity[person] * time_s[:, None],
        velocity=velocity[person],
        desired_speed_mps=speed[person],
    )
    nothing = OccupancyMap(np.zeros((1, 1), bool), np.zeros(2), 1.0)
    return Scene(name, trajectories, nothing, record_s)
