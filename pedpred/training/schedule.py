"""How long and how fast networks are trained."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from pedpred.settings import LARGEST_SEED, In, Settings

_MOST_STEPS = 10**9


@dataclass(frozen=True, kw_only=True)
class Schedule(Settings):
    """How long and how fast a network is trained; the settings of every kind of training extend it.

    Attributes:
        steps: optimiser steps.
        validate_every: steps between two validations (and saved states).
        lr: peak learning rate.
        warmup_steps: steps of linear warm-up.
        seed: of the weights, of the order of the data and of dropout.
    """

    steps: Annotated[int, In(f"[1, {_MOST_STEPS}]")]
    validate_every: Annotated[int, In(f"[1, {_MOST_STEPS}]")]
    lr: Annotated[float, In("(0, 10]")]
    warmup_steps: Annotated[int, In(f"[0, {_MOST_STEPS}]")]
    seed: Annotated[int, In(f"[0, {LARGEST_SEED}]")]


def learning_rate(step: int, steps: int, peak: float, warmup_steps: int, final_share: float = 0.01) -> float:
    """Linear warm-up to `peak`, then half a cosine down to `final_share * peak`."""
    if step < warmup_steps:
        return peak * (step + 1) / warmup_steps
    progress = min(1.0, (step - warmup_steps) / max(1, steps - warmup_steps))
    return peak * (final_share + (1 - final_share) * 0.5 * (1 + math.cos(math.pi * progress)))
