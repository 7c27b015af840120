"""Settings of simulated worlds: the ranges that they are drawn from."""

from __future__ import annotations

from dataclasses import dataclass

from pedpred.errors import ValueRuleError
from pedpred.simulation.fields import LARGEST_SEED, Range
from pedpred.worlds.bottlenecks import BottleneckSettings
from pedpred.worlds.corridors import CorridorSettings
from pedpred.worlds.drawing import check_intervals, nested
from pedpred.worlds.models import ModelSettings
from pedpred.worlds.people import PeopleSettings
from pedpred.worlds.rooms import RoomSettings
from pedpred.worlds.squares import SquareSettings

KINDS = ("corridor", "bottleneck", "room", "square", "lone")
"""Kinds of worlds; in `lone`, people are far from each other, on free ground, and walk exactly straight."""


@dataclass(frozen=True)
class GuidanceSettings:
    """Ranges of `simulation.RoutingSettings`.

    Attributes:
        resolution_m: side of a routing cell.
        narrow_m: least clearance of a route.
        comfortable_m: clearance above which walking costs no more than on open ground.
        slowest: assumed share of the full speed at `narrow_m`.
    """

    resolution_m: float = 0.2
    narrow_m: Range = (0.15, 0.35)
    comfortable_m: Range = (0.4, 0.9)
    slowest: Range = (0.3, 0.9)

    def __post_init__(self) -> None:
        check_intervals(self, {"(0, 1000]": "resolution_m narrow_m comfortable_m", "(0, 1]": "slowest"})
        if not self.narrow_m[1] < self.comfortable_m[0]:
            raise ValueRuleError("narrow_m", self.narrow_m, "it must be less than comfortable_m")


@dataclass(frozen=True)
class LoneSettings:
    """Ranges of people far from each other.

    Attributes:
        people: their number.
        standing_share: share of those who stand.
        speed_mps: of the others; log-uniform, since slow people are the hardest to tell from standing ones.
    """

    people: int = 24
    standing_share: float = 0.3
    speed_mps: Range = (0.2, 2.6)

    def __post_init__(self) -> None:
        check_intervals(self, {"[1, 1000]": "people", "(0, 1000]": "speed_mps"})


@dataclass(frozen=True)
class WorldSettings:
    """How worlds are drawn.

    Attributes:
        seed: of all worlds.
        warm_up_s: discarded at the start.
        duration_s: recorded time.
        bottleneck_s: the same for bottlenecks, where crowds disperse.
        corridor: ranges of corridors.
        bottleneck: ranges of bottlenecks.
        room: ranges of rooms.
        square: ranges of open squares.
        lone: ranges of people far from each other.
        people: ranges of their traits.
        model: ranges of the walking models.
        guidance: ranges of the routes.
    """

    seed: int = 77
    warm_up_s: float = 20.0
    duration_s: float = 50.0
    bottleneck_s: float = 35.0
    corridor: CorridorSettings = nested(CorridorSettings())
    bottleneck: BottleneckSettings = nested(BottleneckSettings())
    room: RoomSettings = nested(RoomSettings())
    square: SquareSettings = nested(SquareSettings())
    lone: LoneSettings = nested(LoneSettings())
    people: PeopleSettings = nested(PeopleSettings())
    model: ModelSettings = nested(ModelSettings())
    guidance: GuidanceSettings = nested(GuidanceSettings())

    def __post_init__(self) -> None:
        check_intervals(self, {"[0, 36000]": "warm_up_s", "(0, 36000]": "duration_s bottleneck_s"})
        check_intervals(self, {f"[0, {LARGEST_SEED}]": "seed"})
