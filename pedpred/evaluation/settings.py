"""Settings of the evaluation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from pedpred.errors import ValueRuleError


@dataclass(frozen=True)
class EvaluationSettings:
    """Thresholds of the metrics and size of the bootstrap; the defaults are those of published figures.

    Attributes:
        moving_mps: slower people count as standing.
        collision_m: people forecast nearer than this at the same step collide.
        miss_m: a forecast whose last position is farther off than this is a miss.
        bootstrap: replicates.
        seed: of the bootstrap.
    """

    moving_mps: float = 0.3
    collision_m: float = 0.2
    miss_m: float = 2.0
    bootstrap: int = 1000
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("moving_mps", "collision_m", "miss_m", "bootstrap"):
            if not getattr(self, name) > 0:
                raise ValueRuleError(name, getattr(self, name), "it must be positive")

    @classmethod
    def parse(cls, plain: Mapping[str, Any]) -> EvaluationSettings:
        """Build from a plain dictionary.

        Raises:
            ValueRuleError: a name is unknown or a value breaks its rule.
        """
        known = [field.name for field in fields(cls)]
        for name in plain.keys() - set(known):
            raise ValueRuleError("evaluation", name, f"known settings are {known}")
        return cls(**plain)
