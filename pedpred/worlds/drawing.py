"""Draws from ranges and shares, and the check of shares."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.simulation.fields import Range


def uniform(rng: np.random.Generator, limits: Range) -> float:
    """Draw a number from a range."""
    return float(rng.uniform(*limits))


def log_uniform(rng: np.random.Generator, limits: Range) -> float:
    """Draw a number whose logarithm is uniform; both limits are positive."""
    return math.exp(rng.uniform(math.log(limits[0]), math.log(limits[1])))


def chosen(rng: np.random.Generator, shares: Mapping[str, float]) -> str:
    """Draw a name with the probability that it maps to."""
    return str(rng.choice(list(shares), p=list(shares.values())))


def check_shares(settings: Any, field: str, names: Collection[str]) -> None:
    """Check that a field maps each name to a share, and that they sum to 1.

    Raises:
        ValueRuleError: it does not.
    """
    value = getattr(settings, field)
    fits = isinstance(value, Mapping) and set(value) == set(names)
    if not fits or min(value.values()) < 0 or abs(sum(value.values()) - 1.0) > 1e-6:
        raise ValueRuleError(field, value, f"it must map {', '.join(names)} to shares that sum to 1")
