"""Folds: which sets each trains on and tests."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

OTHERS, SENSED = "others", "simulated/worlds"
"""What a fold may name in `train`: all places but those that it tests, and sensed worlds, without which
networks with a memory forget walls. Networks without memory add simulated sets by their phase of training."""


def trained_sets(fold: Mapping[str, Any], places: Iterable[str]) -> list[str]:
    """Sets that a fold trains on: kind/name, of those without recording, too.

    Args:
        fold: row of conf/folds with `train`.
        places: names of all places.
    """
    others = [SENSED, *(at for at in (f"real/{place}" for place in places) if at not in fold["test"])]
    return [at for named in fold["train"] for at in (others if named == OTHERS else [named])]
