"""How long and how fast networks are trained."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pedpred.fields import LARGEST_SEED, check_ranges

_MOST_STEPS = 10**9


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """How long and how fast a network is trained; the settings of every kind of training extend it.

    Attributes:
        steps: optimiser steps.
        validate_every: steps between two validations (and saved states).
        lr: peak learning rate.
        warmup_steps: steps of linear warm-up.
        seed: of the weights, of the order of the data and of dropout.
    """

    steps: int
    validate_every: int
    lr: float
    warmup_steps: int
    seed: int

    def __post_init__(self) -> None:
        counts = dict.fromkeys(("steps", "validate_every"), f"[1, {_MOST_STEPS}]")
        check_ranges(self, counts | {"warmup_steps": f"[0, {_MOST_STEPS}]"})
        check_ranges(self, {"lr": "(0, 10]", "seed": f"[0, {LARGEST_SEED}]"})


@dataclass(frozen=True, kw_only=True)
class FitSettings(Schedule):
    """What the trainings of all networks have in common.

    Attributes:
        clip_norm: largest gradient norm.
        weight_decay: decoupled weight decay (the paper's lambda).
        runs: trainings from the same weights, each with the next seed; the network gets the mean of their
            weights, which depends less on the seed (Wortsman et al. 2022).
    """

    clip_norm: float
    weight_decay: float
    runs: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        check_ranges(self, {"clip_norm": "(0, 1e6]", "weight_decay": "[0, 1]", "runs": "[1, 1000]"})


def learning_rate(step: int, steps: int, peak: float, warmup_steps: int, final_share: float = 0.01) -> float:
    """Linear warm-up to `peak`, then half a cosine down to `final_share * peak`."""
    if step < warmup_steps:
        return peak * (step + 1) / warmup_steps
    progress = min(1.0, (step - warmup_steps) / max(1, steps - warmup_steps))
    return peak * (final_share + (1 - final_share) * 0.5 * (1 + math.cos(math.pi * progress)))
