"""From the people of a scene to their tracked states: sensor faults, detection, tracking."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.features.table import FeatureSettings
from pedpred.scenes import Scene
from pedpred.simulation.sensor import SensorSettings, apply_sensor
from pedpred.tracking import KalmanSettings, Tracks, follow, resampled


@dataclass(frozen=True)
class Perception:
    """How people are perceived.

    Attributes:
        kalman: parameters of the tracker; None takes the true states of a simulation.
        standstill_mps: below this speed the heading is held, m/s.
        sensor: faults between people and tracker.
    """

    kalman: KalmanSettings | None
    standstill_mps: float
    sensor: SensorSettings = field(default_factory=SensorSettings)


def parse_tracker(row: Mapping[str, Any]) -> KalmanSettings | None:
    """Build the tracker of a row of conf/trackers; None stands for the kind "truth".

    Raises:
        ValueRuleError: an unknown kind, or a value breaks its rule.
    """
    values = dict(row)
    kind = values.pop("kind")
    if kind not in ("kalman", "truth"):
        raise ValueRuleError("kind", kind, "it must be 'kalman' or 'truth'")
    return KalmanSettings(**values) if kind == "kalman" else None


def sensed(scene: Scene, sensor: SensorSettings) -> Scene:
    """The scene as a sensor detects it; its faults are drawn anew for every name of a scene."""
    if sensor == SensorSettings():
        return scene
    return apply_sensor(scene, sensor, np.random.default_rng([sensor.seed, zlib.crc32(scene.name.encode())]))


def perceived(scene: Scene, how: Perception, sizes: FeatureSettings) -> tuple[Scene, Tracks]:
    """Detect and track the people of a scene.

    Args:
        scene: their true paths.
        how: sensor and tracker.
        sizes: of the features; `noncausal` ones are made of resampled tracks, without sensor and tracker.

    Returns:
        The scene as it is detected, and the tracked states after every detection.
    """
    if sizes.noncausal:
        seen, kalman = resampled(scene, sizes.dt_s, sizes.lost_after_s), None
    else:
        seen, kalman = sensed(scene, how.sensor), how.kalman
    kind = "truth" if kalman is None else "kalman"
    return seen, follow(seen.trajectories, kind, kalman, how.standstill_mps, sizes.lost_after_s)
