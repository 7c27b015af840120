"""Draws from ranges and shares, and what the settings of worlds have in common."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import field, fields
from functools import partial
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.fields import Range, check_ranges, parsed


def uniform(rng: np.random.Generator, limits: Range) -> float:
    """Draw a number from a range."""
    return float(rng.uniform(*limits))


def log_uniform(rng: np.random.Generator, limits: Range) -> float:
    """Draw a number whose logarithm is uniform; both limits are positive."""
    return math.exp(rng.uniform(math.log(limits[0]), math.log(limits[1])))


def draw_name(rng: np.random.Generator, shares: Mapping[str, float]) -> str:
    """Draw a name with the probability that it maps to."""
    return str(rng.choice(list(shares), p=list(shares.values())))


def nested(kind: type) -> Any:
    """Declare a field of settings that holds further settings of a class, parsed from a dictionary."""
    return field(metadata={"parse": partial(parsed, kind)})


def check_intervals(settings: Any, names: Mapping[str, str]) -> None:
    """Check numeric fields as `check_ranges` does; those called `..._share` must lie in [0, 1].

    Args:
        settings: a dataclass.
        names: interval -> names of other fields, separated by spaces.

    Raises:
        ValueRuleError: a field holds something else.
    """
    shares = [known.name for known in fields(settings) if known.name.endswith("_share")]
    others = {name: interval for interval, listed in names.items() for name in listed.split()}
    check_ranges(settings, dict.fromkeys(shares, "[0, 1]") | others)


def check_shares(settings: Any, name: str, names: Collection[str]) -> None:
    """Check that a field maps each name to a share, and that they sum to 1.

    Raises:
        ValueRuleError: it does not.
    """
    check_ranges(settings, {name: "[0, 1]"})
    value = getattr(settings, name)
    if set(value) != set(names) or abs(sum(value.values()) - 1.0) > 1e-6:
        raise ValueRuleError(name, value, f"it must map {', '.join(names)} to shares that sum to 1")
