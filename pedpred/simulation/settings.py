"""The configuration group `social_force` as checked values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pedpred.errors import ConfigError
from pedpred.simulation.forces import ForceSettings
from pedpred.simulation.routing import RoutingSettings

LARGEST_STEP_S = 0.1  # beyond it the border force (R = 0.2 m) is stepped over


@dataclass(frozen=True)
class CrowdSettings:
    """Who walks, and where to.

    Attributes:
        mean_speed_mps: mean of the desired speeds.
        speed_deviation_mps: their standard deviation.
        speed_range_mps: speeds outside are drawn again. (least, most)
        targets: size of an arrangement's pool of targets.
        target_spacing_m: least distance between two targets.
        least_leg_m: distance between a target and the next one (less only where none is farther).
        reach_m: a target counts as reached at this distance.
        clearance_m: free ground around targets and starting positions.
        spacing_m: least distance between two starting positions.
    """

    mean_speed_mps: float
    speed_deviation_mps: float
    speed_range_mps: tuple[float, float]
    targets: int
    target_spacing_m: float
    least_leg_m: float
    reach_m: float
    clearance_m: float
    spacing_m: float


@dataclass(frozen=True)
class ClockSettings:
    """Time steps.

    Attributes:
        step_s: integration step, at most 0.1; a test bounds what halving it changes.
        record_s: time between two recorded states.
        warm_up_s: discarded at the start.
        noise_mps2: sigma of the random acceleration.
        noise_hold_s: how long one random acceleration lasts.
    """

    step_s: float
    record_s: float
    warm_up_s: float
    noise_mps2: float
    noise_hold_s: float

    def __post_init__(self) -> None:
        if not 0 < self.step_s <= LARGEST_STEP_S:
            raise ConfigError(
                "social_force.clock.step_s", self.step_s, f"it must lie in (0, {LARGEST_STEP_S}] s"
            )
        for name in ("record_s", "noise_hold_s"):
            value = getattr(self, name)
            if abs(value / self.step_s - round(value / self.step_s)) > 1e-6:
                raise ConfigError(
                    f"social_force.clock.{name}", value, f"make it a multiple of step_s = {self.step_s}"
                )


@dataclass(frozen=True)
class SocialForceSettings:
    """Everything that the simulator and the social-force forecaster are told."""

    forces: ForceSettings
    routing: RoutingSettings
    crowd: CrowdSettings
    clock: ClockSettings


def social_force_settings(cfg: Mapping[str, Any]) -> SocialForceSettings:
    """Read the group `social_force`.

    Raises:
        ConfigError: a key is missing or unknown, or a value breaks its rule.
    """
    forces = dict(_block(cfg, "forces"))
    angle = forces.pop("sight_half_angle_deg", None)
    if angle is not None:
        forces["sight_cosine"] = math.cos(math.radians(angle))
    crowd = dict(_block(cfg, "crowd"))
    crowd["speed_range_mps"] = tuple(crowd.get("speed_range_mps", ()))
    return SocialForceSettings(
        _build(ForceSettings, "forces", {name: float(value) for name, value in forces.items()}),
        _build(RoutingSettings, "routing", dict(_block(cfg, "routing"))),
        _build(CrowdSettings, "crowd", crowd),
        _build(ClockSettings, "clock", dict(_block(cfg, "clock"))),
    )


def _block(cfg: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    if name not in cfg:
        raise ConfigError(f"social_force.{name}", None, "it is missing")
    return cfg[name]


def _build(kind: type, name: str, values: dict[str, Any]) -> Any:
    try:
        return kind(**values)
    except TypeError as cause:
        raise ConfigError(f"social_force.{name}", values, str(cause)) from cause
