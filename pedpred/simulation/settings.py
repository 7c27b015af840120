"""Settings of the simulator: the walking model, its crowd and clock, and simulated data sets."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple

from pedpred.errors import ValueRuleError
from pedpred.settings import (
    LARGEST_SEED,
    In,
    Range,
    Settings,
    check_fields,
    load,
)

_NARROWEST = 0.1
"""Least width of the range of speeds, in deviations: at least 2 % of the draws lie in it."""


class ForceSettings(NamedTuple):
    """Constants of the model, Helbing & Molnar 1995, section III.

    Attributes:
        relaxation_time_s: tau, time to regain the desired velocity.
        speed_cap: largest speed as a multiple of the desired one.
        pedestrian_strength: V0, m^2/s^2.
        pedestrian_range_m: sigma.
        anticipation_s: Delta t, the ellipse looks s = |v| Delta t ahead of the other.
        border_strength: U0, m^2/s^2.
        border_range_m: R.
        sight_cosine: cosine of the half angle of sight.
        unseen_weight: c, weight of a force from outside the field of sight.
        group_gaze: beta_1 of Moussaid et al. 2010, 1/s per radian.
        group_attraction: beta_2, m/s^2.
        group_repulsion: beta_3, m/s^2.
        group_distance_m: d0, members closer than this repel each other.
    """

    relaxation_time_s: Annotated[float, In("(0, 100]")]
    speed_cap: Annotated[float, In("(0, 100]")]
    pedestrian_strength: Annotated[float, In("[0, 10000]")]
    pedestrian_range_m: Annotated[float, In("(0, 100]")]
    anticipation_s: Annotated[float, In("[0, 10000]")]
    border_strength: Annotated[float, In("[0, 10000]")]
    border_range_m: Annotated[float, In("(0, 100]")]
    sight_cosine: Annotated[float, In("[-1, 1]")]
    unseen_weight: Annotated[float, In("[0, 1]")]
    group_gaze: Annotated[float, In("[0, 10000]")]
    group_attraction: Annotated[float, In("[0, 10000]")]
    group_repulsion: Annotated[float, In("[0, 10000]")]
    group_distance_m: Annotated[float, In("[0, 10000]")]


@dataclass(frozen=True)
class RoutingSettings(Settings):
    """How routes trade length against clearance.

    Attributes:
        resolution_m: side of a routing cell; the map's cells may be finer.
        narrow_m: least clearance of a route; the border force keeps people out of narrower gaps.
        comfortable_m: clearance above which walking costs no more than on open ground.
        slowest: assumed share of the full speed at `narrow_m`. Values far below 1 bend the directions
            across narrow passages instead of along them.
    """

    resolution_m: Annotated[float, In("(0, 100]")]
    narrow_m: Annotated[float, In("(0, 100]")]
    comfortable_m: Annotated[float, In("(0, 100]")]
    slowest: Annotated[float, In("(0, 1]")]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.narrow_m < self.comfortable_m:
            raise ValueRuleError("narrow_m", self.narrow_m, "it must be less than comfortable_m")


@dataclass(frozen=True)
class CrowdSettings(Settings):
    """Desired speeds, targets and distances of a crowd.

    Attributes:
        mean_speed_mps: mean of the desired speeds.
        speed_deviation_mps: their standard deviation.
        speed_range_mps: speeds outside are drawn again; contains the mean, and a share of the draws.
        targets: size of a room's pool of targets.
        target_spacing_m: least distance between two targets.
        least_leg_m: least distance between successive targets (less only where none is farther).
        reach_m: distance at which a target counts as reached.
        clearance_m: free ground around targets and starting positions.
        spacing_m: least distance between two starting positions.
    """

    mean_speed_mps: Annotated[float, In("(0, 10]")]
    speed_deviation_mps: Annotated[float, In("(0, 10]")]
    speed_range_mps: Annotated[Range, In("(0, 10]")]
    targets: Annotated[int, In("[2, 1000]")]
    target_spacing_m: Annotated[float, In("[0, 1000]")]
    least_leg_m: Annotated[float, In("[0, 1000]")]
    reach_m: Annotated[float, In("(0, 10]")]
    clearance_m: Annotated[float, In("[0, 1000]")]
    spacing_m: Annotated[float, In("[0, 1000]")]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.speed_range_mps[0] <= self.mean_speed_mps <= self.speed_range_mps[1]:
            raise ValueRuleError("speed_range_mps", self.speed_range_mps, "it must contain mean_speed_mps")
        if self.speed_range_mps[1] - self.speed_range_mps[0] < _NARROWEST * self.speed_deviation_mps:
            rule = f"it must be at least {_NARROWEST} speed_deviation_mps wide: other draws are repeated"
            raise ValueRuleError("speed_range_mps", self.speed_range_mps, rule)


@dataclass(frozen=True)
class ClockSettings(Settings):
    """Time steps.

    Attributes:
        step_s: integration step; above 0.1 s people step over the border force (R = 0.2 m).
        record_s: time between two recorded states; a multiple of `step_s`.
        warm_up_s: discarded at the start.
        noise_mps2: sigma of the random acceleration.
        noise_hold_s: duration of one random acceleration; a multiple of `step_s`.
    """

    step_s: Annotated[float, In("[0.001, 0.1]")]
    record_s: Annotated[float, In("(0, 60]")]
    warm_up_s: Annotated[float, In("[0, 3600]")]
    noise_mps2: Annotated[float, In("[0, 100]")]
    noise_hold_s: Annotated[float, In("(0, 60]")]

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("record_s", "noise_hold_s"):
            value = getattr(self, name)
            if round(value / self.step_s) < 1 or abs(value / self.step_s - round(value / self.step_s)) > 1e-6:
                raise ValueRuleError(name, value, f"it must be a multiple of step_s = {self.step_s}")


def _forces(plain: Any, path: str) -> ForceSettings:
    """Parse the constants of the model; the field of sight is given as an angle."""
    known = [name.replace("sight_cosine", "sight_half_angle_deg") for name in ForceSettings._fields]
    if not isinstance(plain, Mapping) or sorted(plain) != sorted(known):
        wrong = sorted(set(plain) ^ set(known)) if isinstance(plain, Mapping) else plain
        raise ValueRuleError(path, wrong, f"its fields are {', '.join(known)}")
    values = {n: float(v) if type(v) is int else v for n, v in plain.items() if n != "sight_half_angle_deg"}
    angle = plain["sight_half_angle_deg"]
    if isinstance(angle, bool) or not isinstance(angle, (int, float)) or not 0 <= angle <= 180:
        raise ValueRuleError(f"{path}.sight_half_angle_deg", angle, "it must be a number in [0, 180]")
    return ForceSettings(**values, sight_cosine=math.cos(math.radians(angle)))


@dataclass(frozen=True)
class SocialForceSettings:
    """Parameters of the simulator and of the social-force forecasters."""

    forces: ForceSettings = field(metadata={"parse": _forces})
    routing: RoutingSettings
    crowd: CrowdSettings
    clock: ClockSettings

    def __post_init__(self) -> None:
        try:
            check_fields(self.forces)
        except ValueRuleError as cause:
            raise ValueRuleError(f"forces.{cause.field}", cause.value, cause.rule) from cause
        if (time_s := self.forces.relaxation_time_s) < self.clock.step_s:
            rule = f"it must be at least clock.step_s = {self.clock.step_s}, otherwise velocities oscillate"
            raise ValueRuleError("forces.relaxation_time_s", time_s, rule)


def social_force_settings(plain: Mapping[str, Any]) -> SocialForceSettings:
    """Parse `forces`, `routing`, `crowd` and `clock`.

    Raises:
        ValueRuleError: a field is missing or unknown, or breaks its rule.
    """
    return load(SocialForceSettings, plain)


@dataclass(frozen=True)
class SimulationSettings(Settings):
    """A simulated data set.

    Attributes:
        drawn: names of layouts.
        generated: number of random rooms.
        pedestrians: per room.
        hours: recorded time, shared equally among the rooms.
        seed: fixes, together with a room's name, all random numbers of that room.
    """

    drawn: tuple[str, ...]
    generated: Annotated[int, In("[0, 100000]")]
    pedestrians: Annotated[int, In("[1, 10000]")]
    hours: Annotated[float, In("(0, 100000]")]
    seed: Annotated[int, In(f"[0, {LARGEST_SEED}]")]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.rooms:
            raise ValueRuleError("drawn", self.drawn, "name a layout or set 'generated' above 0")
        if len(set(self.rooms)) < len(self.rooms):
            raise ValueRuleError("drawn", self.drawn, "the names of rooms must differ")

    @property
    def rooms(self) -> list[str]:
        """Names of all rooms."""
        return [*self.drawn, *(f"room{index:03d}" for index in range(self.generated))]
