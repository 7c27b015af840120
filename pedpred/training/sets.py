"""Which sets of rows a network is trained on, and how simulated and recorded ones are mixed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from pedpred.errors import ValueRuleError
from pedpred.settings import In, Settings


@dataclass(frozen=True, kw_only=True)
class NamedSets(Settings):
    """What a phase is trained on, whatever the fold.

    Attributes:
        sets: kind/name of each, below data/rows.
    """

    sets: tuple[str, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.sets:
            raise ValueRuleError("sets", self.sets, "it must name a set such as simulated/main")


@dataclass(frozen=True, kw_only=True)
class RealShare(Settings):
    """How much of the rows of an adaptation is real.

    Attributes:
        real_share: share of the rows that real sets divide among each other.
        size_exponent: a real set of n rows gets a part proportional to n ** size_exponent: with 0, all get
            the same; with 0.5, long recordings count more, and short ones are not lost.
    """

    real_share: Annotated[float, In("[0, 1]")] = 0.0
    size_exponent: Annotated[float, In("[0, 1]")] = 0.0

    def mix(self, simulated: Mapping[str, float], real: Mapping[str, int]) -> dict[str, float]:
        """Shares of simulated and real sets, which sum to 1.

        Args:
            simulated: set -> its share of the simulated rows.
            real: set -> number of its rows; if there is none, all rows are simulated.
        """
        part, whole = self.real_share if real else 0.0, sum(simulated.values())
        weights = {name: float(rows) ** self.size_exponent for name, rows in real.items()}
        return {name: (1 - part) * share / whole for name, share in simulated.items()} | {
            name: part * weight / sum(weights.values()) for name, weight in weights.items()
        }
