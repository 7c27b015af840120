"""The forecasters as data: where each is applied, and its settings. Rows of `conf/methods`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pedpred.settings import Settings, check_choice

WHERE = ("simulated", "real")
"""Kinds of test sets."""


@dataclass(frozen=True)
class MethodRow(Settings):
    """One row.

    Attributes:
        where: kinds of test sets that it is applied to, see `WHERE`.
        settings: arguments of its factory: options of a baseline, or architecture and sizes of a network.
    """

    where: tuple[str, ...]
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        for kind in self.where:
            check_choice("where", kind, WHERE)
