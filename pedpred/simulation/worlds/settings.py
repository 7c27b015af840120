"""Settings of simulated worlds: the ranges that they are drawn from."""

from __future__ import annotations

from dataclasses import dataclass

from pedpred.errors import ValueRuleError
from pedpred.fields import LARGEST_SEED, Range
from pedpred.simulation.worlds.bottlenecks import BottleneckSettings
from pedpred.simulation.worlds.corridors import CorridorSettings
from pedpred.simulation.worlds.drawing import check_intervals, nested
from pedpred.simulation.worlds.lone import LoneSettings
from pedpred.simulation.worlds.models import ModelSettings
from pedpred.simulation.worlds.people import PeopleSettings
from pedpred.simulation.worlds.rooms import RoomSettings
from pedpred.simulation.worlds.squares import SquareSettings


@dataclass(frozen=True)
class GuidanceSettings:
    """Ranges of `simulation.RoutingSettings`.

    Attributes:
        resolution_m: side of a routing cell.
        narrow_m: least clearance of a route.
        comfortable_m: clearance above which walking costs no more than on open ground.
        slowest: assumed share of the full speed at `narrow_m`.
    """

    resolution_m: float
    narrow_m: Range
    comfortable_m: Range
    slowest: Range

    def __post_init__(self) -> None:
        check_intervals(self, {"(0, 1000]": "resolution_m narrow_m comfortable_m", "(0, 1]": "slowest"})
        if not self.narrow_m[1] < self.comfortable_m[0]:
            raise ValueRuleError("narrow_m", self.narrow_m, "it must be less than comfortable_m")


@dataclass(frozen=True)
class WorldSettings:
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

    seed: int
    warm_up_s: float
    corridor: CorridorSettings = nested(CorridorSettings)
    bottleneck: BottleneckSettings = nested(BottleneckSettings)
    room: RoomSettings = nested(RoomSettings)
    square: SquareSettings = nested(SquareSettings)
    lone: LoneSettings = nested(LoneSettings)
    people: PeopleSettings = nested(PeopleSettings)
    model: ModelSettings = nested(ModelSettings)
    guidance: GuidanceSettings = nested(GuidanceSettings)

    def __post_init__(self) -> None:
        check_intervals(self, {"[0, 36000]": "warm_up_s", f"[0, {LARGEST_SEED}]": "seed"})
