"""Folds: which sets each trains on and tests."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

OTHERS, OTHER_PLACES, SENSED = "others", "other_places", "simulated/worlds"
"""What a fold may name in `train`: all places but those that it tests, with or without sensed worlds, without
which networks with a memory forget walls. Networks without memory add simulated sets by their phase."""


def trained_sets(fold: Mapping[str, Any], places: Iterable[str]) -> list[str]:
    """Sets that a fold trains on: kind/name, of those without recording, too.

    Args:
        fold: row of conf/folds with `train`.
        places: names of all places.
    """
    others = [at for at in (f"real/{place}" for place in places) if at not in fold["test"]]
    words = {OTHERS: [SENSED, *others], OTHER_PLACES: others}
    return [at for named in fold["train"] for at in words.get(named, [named])]
