"""From the people of a scene to their tracked states: sensor faults, detection, tracking."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import numpy as np

from pedpred.features.table import ForecastProtocol
from pedpred.scenes import Scene
from pedpred.settings import (
    In,
    Settings,
    check_choice,
    check_mapping,
    check_names,
    load,
)
from pedpred.simulation.sensor import SensorSettings, apply_sensor
from pedpred.tracking import KalmanBank, KalmanSettings, Tracks, follow, resampled, tune_kalman

_FITTED = 20_000
"""Trackers are fitted to about this many detections, of people spread evenly over the ids."""


@dataclass(frozen=True, kw_only=True)
class Following(Settings):
    """How people are followed, whatever the tracker's parameters.

    Attributes:
        standstill_mps: below this speed the heading is held, m/s.
        learn_noise: whether a tracker learns the noise of each person's detections, see
            `pedpred.tracking.noise`.
    """

    standstill_mps: Annotated[float, In("[0, 100]")]
    learn_noise: bool


@dataclass(frozen=True)
class Perception:
    """How people are perceived.

    Attributes:
        kalman: parameters of the tracker, or filters that are weighted; None takes the true states of a
            simulation.
        standstill_mps: below this speed the heading is held, m/s.
        sensor: faults between people and tracker.
    """

    kalman: KalmanSettings | KalmanBank | None
    standstill_mps: float
    sensor: SensorSettings = field(default_factory=SensorSettings)


def parse_tracker(row: Mapping[str, Any]) -> KalmanSettings | None:
    """Build the tracker of a row of conf/trackers; None stands for the kind "truth".

    Raises:
        ValueRuleError: an unknown kind, or a value breaks its rule.
    """
    check_mapping("", row)
    values = dict(row)
    kind = values.pop("kind", None)
    check_choice("kind", kind, ("kalman", "truth"))
    if kind == "kalman":
        return load(KalmanSettings, values)
    check_names((), values, "", "the true states have no settings")
    return None


def sensed(scene: Scene, sensor: SensorSettings) -> Scene:
    """The scene as a sensor detects it; its faults are drawn anew for every name of a scene."""
    if sensor == SensorSettings():
        return scene
    return apply_sensor(scene, sensor, np.random.default_rng([sensor.seed, zlib.crc32(scene.name.encode())]))


def perceived(scene: Scene, how: Perception, protocol: ForecastProtocol) -> tuple[Scene, Tracks]:
    """Detect and track the people of a scene.

    Args:
        scene: their true paths.
        how: sensor and tracker.
        protocol: `noncausal` inputs are made of resampled tracks, without sensor and tracker.

    Returns:
        The scene as it is detected, and the tracked states after every detection.
    """
    if protocol.noncausal:
        seen, kalman = resampled(scene, protocol.dt_s, protocol.lost_after_s), None
    else:
        seen, kalman = sensed(scene, how.sensor), how.kalman
    kind = "truth" if kalman is None else "kalman"
    return seen, follow(seen.trajectories, kind, kalman, how.standstill_mps, protocol.lost_after_s)


def fitted(scene: Scene, how: Perception, protocol: ForecastProtocol) -> Perception:
    """How people are perceived with a tracker that is fitted to the detections of this very scene.

    For simple methods that networks are compared with, so that these are as good as they can be: the noise
    is the most likely one over the forecasts' horizon, whole recording known. True states need no tracker.

    Args:
        scene: their true paths.
        how: sensor, and a tracker in whose place the fitted one comes.
        protocol: its horizon.

    Raises:
        ValueRuleError: nobody is detected twice.
    """
    if how.kalman is None or protocol.noncausal:
        return how
    seen = sensed(scene, how.sensor)
    people = seen.trajectories
    names = np.unique(people.track_id)
    some = names[:: -(-len(people) // _FITTED)]
    ahead = max(1, round(protocol.horizon_steps * protocol.dt_s / seen.detection_dt_s))
    return replace(how, kalman=tune_kalman(people.select(np.isin(people.track_id, some)), ahead, 0.01))
