"""Settings of simulated worlds: the ranges that they are drawn from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pedpred.errors import ValueRuleError
from pedpred.settings import (
    LARGEST_SEED,
    In,
    Range,
    Settings,
)
from pedpred.simulation.worlds.bottlenecks import BottleneckSettings
from pedpred.simulation.worlds.corridors import CorridorSettings
from pedpred.simulation.worlds.drawing import Uniform
from pedpred.simulation.worlds.lone import LoneSettings
from pedpred.simulation.worlds.models import ModelSettings
from pedpred.simulation.worlds.people import PeopleSettings
from pedpred.simulation.worlds.rooms import RoomSettings
from pedpred.simulation.worlds.squares import SquareSettings


@dataclass(frozen=True)
class GuidanceSettings(Settings):
    """Ranges of `simulation.RoutingSettings`.

    Attributes:
        resolution_m: side of a routing cell.
        narrow_m: least clearance of a route.
        comfortable_m: clearance above which walking costs no more than on open ground.
        slowest: assumed share of the full speed at `narrow_m`.
    """

    resolution_m: Annotated[float, In("(0, 1000]")]
    narrow_m: Annotated[Range, Uniform("(0, 1000]")]
    comfortable_m: Annotated[Range, Uniform("(0, 1000]")]
    slowest: Annotated[Range, Uniform("(0, 1]")]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.narrow_m[1] < self.comfortable_m[0]:
            raise ValueRuleError("narrow_m", self.narrow_m, "it must be less than comfortable_m")


@dataclass(frozen=True)
class WorldSettings(Settings):
    """How worlds are drawn.

    Attributes:
        seed: of all worlds.
        warm_up_s: discarded at the start.
        corridor: ranges of corridors.
        bottleneck: ranges of bottlenecks.
        room: ranges of rooms.
        square: ranges of open squares.
        lone: ranges of people far from each other.
        people: ranges of their traits.
        model: ranges of the walking models.
        guidance: ranges of the routes.
    """

    seed: Annotated[int, In(f"[0, {LARGEST_SEED}]")]
    warm_up_s: Annotated[float, In("[0, 36000]")]
    corridor: CorridorSettings
    bottleneck: BottleneckSettings
    room: RoomSettings
    square: SquareSettings
    lone: LoneSettings
    people: PeopleSettings
    model: ModelSettings
    guidance: GuidanceSettings
