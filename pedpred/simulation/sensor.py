"""What a sensor makes of people who are really there: fewer, noisier and confused detections."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import Scene, Trajectories


@dataclass(frozen=True)
class SensorSettings:
    """Faults of a sensor; the defaults are a perfect one.

    Attributes:
        every: only each so many-th instant is seen.
        position_noise_m: standard deviation of a coordinate, m.
        quantum_m: coordinates are rounded to multiples of this; 0 = not at all, m.
        drop_out_share: share of the detections that are missing.
        switch_share: share of the instants at which two people who are each other's nearest and within
            `switch_range_m` swap their ids for good.
        switch_range_m: m.
        seed: of the faults.
    """

    every: int = 1
    position_noise_m: float = 0.0
    quantum_m: float = 0.0
    drop_out_share: float = 0.0
    switch_share: float = 0.0
    switch_range_m: float = 0.8
    seed: int = 0

    def __post_init__(self) -> None:
        if self.every < 1 or int(self.every) != self.every:
            raise ValueRuleError("sensor.every", self.every, "it must be a whole number above 0")
        for name in ("position_noise_m", "quantum_m", "switch_range_m"):
            if not getattr(self, name) >= 0:
                raise ValueRuleError(f"sensor.{name}", getattr(self, name), "it must not be negative")
        for name in ("drop_out_share", "switch_share"):
            if not 0 <= getattr(self, name) < 1:
                raise ValueRuleError(f"sensor.{name}", getattr(self, name), "it must lie in [0, 1)")


def apply_sensor(scene: Scene, settings: SensorSettings, rng: np.random.Generator) -> Scene:
    """The scene as a sensor reports it; only `person_id` still knows who was who.

    Velocities, goals and groups are not measured.

    Args:
        scene: what really happened.
        settings: the faults.
        rng: source of all randomness; derive it from (seed, scene).
    """
    trajectories = scene.trajectories
    instants, instant = np.unique(trajectories.time_s, return_inverse=True)
    starts = np.searchsorted(instant, np.arange(len(instants) + 1))
    track_id = _confused(trajectories, starts, settings, rng)
    position = trajectories.position + rng.normal(0.0, settings.position_noise_m, trajectories.position.shape)
    if settings.quantum_m:
        position = np.round(position / settings.quantum_m) * settings.quantum_m
    kept = (instant % settings.every == 0) & (rng.random(len(trajectories)) >= settings.drop_out_share)
    seen = Trajectories(
        trajectories.time_s[kept], track_id[kept], position[kept], person_id=trajectories.track_id[kept]
    )
    return replace(scene, trajectories=seen, detection_dt_s=scene.detection_dt_s * settings.every)


def _confused(
    trajectories: Trajectories, starts: np.ndarray, settings: SensorSettings, rng: np.random.Generator
) -> np.ndarray:
    """Ids after all swaps up to each instant. [M]."""
    names, person = np.unique(trajectories.track_id, return_inverse=True)
    called, track_id = names.copy(), np.empty_like(trajectories.track_id)
    for first, last in pairwise(starts):
        who = person[first:last]
        if rng.random() < settings.switch_share:
            for a, b in _close_pairs(trajectories.position[first:last], settings.switch_range_m):
                called[who[[a, b]]] = called[who[[b, a]]]
        track_id[first:last] = called[who]
    return track_id


def _close_pairs(position: np.ndarray, range_m: float) -> list[tuple[int, int]]:
    """Pairs who are each other's nearest and not farther apart than `range_m`."""
    if len(position) < 2:
        return []
    apart = np.linalg.norm(position[:, None] - position[None], axis=-1)
    np.fill_diagonal(apart, np.inf)
    nearest = apart.argmin(axis=1)
    mutual = (nearest[nearest] == np.arange(len(position))) & (apart.min(axis=1) <= range_m)
    return [(int(a), int(nearest[a])) for a in np.flatnonzero(mutual) if a < nearest[a]]
