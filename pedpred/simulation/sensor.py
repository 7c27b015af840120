"""Sensor faults: missed and noisy detections, and swapped ids."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pedpred.scenes import Scene, Trajectories
from pedpred.simulation.fields import LARGEST_SEED, check_ranges


@dataclass(frozen=True)
class SensorSettings:
    """Faults of a sensor; the defaults are a perfect one.

    Attributes:
        every: only every n-th instant is detected.
        position_noise_m: standard deviation of a coordinate, m.
        quantum_m: coordinates are rounded to multiples of this; 0 = not at all, m.
        drop_out_share: share of missing detections.
        switch_share: share of the instants at which pairs of mutual nearest neighbours within
            `switch_range_m` swap their ids permanently.
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
        check_ranges(self, {"every": "[1, 1000000]", "drop_out_share": "[0, 1)", "switch_share": "[0, 1)"})
        names = ("position_noise_m", "quantum_m", "switch_range_m")
        check_ranges(self, dict.fromkeys(names, "[0, 1000]") | {"seed": f"[0, {LARGEST_SEED}]"})


def apply_sensor(scene: Scene, settings: SensorSettings, rng: np.random.Generator) -> Scene:
    """Replace the detections of a scene by those of a faulty sensor; `person_id` keeps the true identity.

    Velocities, goals and groups are dropped.

    Args:
        scene: true positions.
        settings: the faults.
        rng: source of all randomness; derive it from (seed, scene).
    """
    trajectories = scene.trajectories
    instants, instant = np.unique(trajectories.time_s, return_inverse=True)
    starts = np.searchsorted(instant, np.arange(len(instants) + 1))
    track_id = _confused(trajectories, starts, settings, rng)
    position = measured(trajectories.position, settings.position_noise_m, settings.quantum_m, rng)
    kept = (instant % settings.every == 0) & (rng.random(len(trajectories)) >= settings.drop_out_share)
    seen = Trajectories(
        trajectories.time_s[kept], track_id[kept], position[kept], person_id=trajectories.track_id[kept]
    )
    return replace(scene, trajectories=seen, detection_dt_s=scene.detection_dt_s * settings.every)


def measured(position: np.ndarray, noise_m: float, quantum_m: float, rng: np.random.Generator) -> np.ndarray:
    """Add noise to coordinates, m, and round them to multiples of the quantum, if there is one. [M, 2]."""
    noisy = position + rng.normal(0.0, noise_m, position.shape)
    return np.round(noisy / quantum_m) * quantum_m if quantum_m else noisy


def _confused(
    trajectories: Trajectories, starts: np.ndarray, settings: SensorSettings, rng: np.random.Generator
) -> np.ndarray:
    """Track ids after all swaps up to each instant. [M]."""
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
    """Pairs of mutual nearest neighbours at most `range_m` apart."""
    if len(position) < 2:
        return []
    apart = np.linalg.norm(position[:, None] - position[None], axis=-1)
    np.fill_diagonal(apart, np.inf)
    nearest = apart.argmin(axis=1)
    mutual = (nearest[nearest] == np.arange(len(position))) & (apart.min(axis=1) <= range_m)
    return [(int(a), int(nearest[a])) for a in np.flatnonzero(mutual) if a < nearest[a]]
