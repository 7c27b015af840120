"""Draws from ranges and shares, and what the settings of worlds have in common."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from typing import Any, get_args, get_type_hints

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.settings import In, Range, Settings


def uniform(rng: np.random.Generator, limits: Range) -> float:
    """Draw a number from a range."""
    return float(rng.uniform(*limits))


def log_uniform(rng: np.random.Generator, limits: Range) -> float:
    """Draw a number whose logarithm is uniform; both limits are positive."""
    return math.exp(rng.uniform(math.log(limits[0]), math.log(limits[1])))


def whole_number(rng: np.random.Generator, limits: tuple[int, int]) -> int:
    """Draw a whole number; both limits are possible."""
    return int(rng.integers(limits[0], limits[1] + 1))


class Uniform(In):
    """Limits of a range from which `draw_fields` draws uniformly."""


class LogUniform(In):
    """Limits of a range from which `draw_fields` draws a number whose logarithm is uniform."""


_LAWS: dict[type, Callable[[np.random.Generator, Range], float]] = {Uniform: uniform, LogUniform: log_uniform}


def draw_fields(settings: Settings, rng: np.random.Generator) -> dict[str, float]:
    """Draw a number from each range whose annotation has a law, in the order of the fields."""
    drawn = {}
    for name, hint in get_type_hints(type(settings), include_extras=True).items():
        for rule in get_args(hint)[1:]:
            if type(rule) in _LAWS:
                drawn[name] = _LAWS[type(rule)](rng, getattr(settings, name))
    return drawn


def draw_name(rng: np.random.Generator, shares: Mapping[str, float]) -> str:
    """Draw a name with the probability that it maps to."""
    return str(rng.choice(list(shares), p=list(shares.values())))


def check_shares(settings: Any, name: str, names: Collection[str]) -> None:
    """Check that a field maps each name to a share, and that they sum to 1.

    Raises:
        ValueRuleError: it does not.
    """
    value = getattr(settings, name)
    if set(value) != set(names) or abs(sum(value.values()) - 1.0) > 1e-6:
        raise ValueRuleError(name, value, f"it must map {', '.join(names)} to shares that sum to 1")
