"""How people are perceived in a set of scenes, and what networks read: settings that several stages make."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from omegaconf import DictConfig

from pedpred.config import configured, part, row
from pedpred.errors import ConfigError
from pedpred.evaluation.observed import WindowSettings
from pedpred.features import ForecastProtocol, ModelFeatures
from pedpred.features.perception import Following, Perception, parse_tracker
from pedpred.models.features import parse_features
from pedpred.settings import load, load_together
from pedpred.simulation.sensor import SensorSettings
from pedpred.tracking import KalmanBank, KalmanSettings

OBSERVED = "observed_steps"
"""Key of a protocol that limits what is known in a window."""


def perception_of(cfg: DictConfig, source: DictConfig) -> tuple[Perception, ForecastProtocol]:
    """Build how people are perceived in the scenes of a row of simulations or places, and the protocol."""
    with configured(f"trackers.{source.tracker}"):
        kalman = parse_tracker(row(cfg, "trackers", source.tracker))
    with configured(f"sensors.{source.sensor}"):
        sensor = load(SensorSettings, row(cfg, "sensors", source.sensor))
    protocol, how = protocol_of(cfg)
    if kalman is None:  # true states need no differences, so inputs cannot leak the future
        return Perception(None, how.standstill_mps, sensor), replace(protocol, noncausal=False)
    return Perception(KalmanBank.around(kalman, how.learn_noise), how.standstill_mps, sensor), protocol


def protocol_of(cfg: Mapping[str, Any]) -> tuple[ForecastProtocol, Following]:
    """Read what all forecasts have in common, and how people are followed."""
    options = {key: value for key, value in part(cfg, "protocol").items() if key != OBSERVED}
    with configured("protocol"):
        protocol, how = load_together([ForecastProtocol, Following], options)
    return protocol, how


def windows_of(cfg: Mapping[str, Any]) -> WindowSettings | None:
    """Read the windows of a protocol that limits what is known in them; None: it does not."""
    (protocol, _), options = protocol_of(cfg), part(cfg, "protocol")
    if OBSERVED not in options:
        return None
    ahead, step_s = protocol.horizon_steps, protocol.dt_s
    with configured("protocol"):
        return WindowSettings(observed_steps=options[OBSERVED], predicted_steps=ahead, step_s=step_s)


def features_of(cfg: Mapping[str, Any], model: str) -> ModelFeatures:
    """Read the sizes of a model's inputs."""
    with configured(f"features.{model}"):
        return parse_features(model, part(cfg, "features", model))


def kalman_of(cfg: Mapping[str, Any], name: str) -> KalmanSettings:
    """Read a tracker's row.

    Raises:
        ConfigError: there is none, it breaks a rule, or it is no Kalman filter.
    """
    with configured(f"trackers.{name}"):
        kalman = parse_tracker(row(cfg, "trackers", name))
    if kalman is None:
        raise ConfigError(f"trackers.{name}.kind", "truth", "a Kalman filter is needed here")
    return kalman
