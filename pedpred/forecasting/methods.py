"""The compared methods as data: how each is called, coloured and used. Rows of `conf/methods`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from pedpred.errors import ValueRuleError
from pedpred.fields import check_choice, check_mapping, check_ranges, parsed

ROLES = ("baseline", "reference", "oracle", "ablation", "network")
"""baseline: simple and causal. reference: the strongest of these, which paired differences are taken to.
oracle: knows the future goal. ablation: the network `of` without one of its parts. network: a learned method;
the last one listed is what reports are about."""


WHERE = ("simulated", "real", "literature")
"""Kinds of test sets."""


@dataclass(frozen=True)
class Method:
    """One row.

    Attributes:
        key: its name in files, commands and configuration.
        label: name in reports.
        colour: of its lines, #RRGGBB.
        role: one of `ROLES`.
        where: kinds of test sets that it is applied to, see `WHERE`.
        settings: arguments of its factory: options of a baseline, or architecture and sizes of a network.
        of: key of the network that an ablation is compared with; empty for other roles.
    """

    key: str
    label: str
    colour: str
    role: str
    where: tuple[str, ...]
    settings: Mapping[str, Any] = field(default_factory=dict)
    of: str = ""

    def __post_init__(self) -> None:
        check_ranges(self, {})
        check_mapping("settings", self.settings)
        if not re.fullmatch("#[0-9A-Fa-f]{6}", self.colour):
            raise ValueRuleError("colour", self.colour, "it must be #RRGGBB")
        check_choice("role", self.role, ROLES)
        for kind in self.where:
            check_choice("where", kind, WHERE)
        if (self.role == "ablation") != bool(self.of):
            rule = "a method with the role ablation, and no other, names the network it is compared with"
            raise ValueRuleError("of", self.of, rule)

    @property
    def learned(self) -> bool:
        """Whether it has weights."""
        return self.role in ("ablation", "network")


@dataclass(frozen=True)
class Methods:
    """All rows, in the order of display; the method that reports are about comes last."""

    rows: tuple[Method, ...]

    def __post_init__(self) -> None:
        for role in ("reference", "network"):
            if not any(row.role == role for row in self.rows):
                raise ValueRuleError("methods", role, "one method must have this role")
        networks = [row.key for row in self.networks]
        for row in self.rows:
            if row.of and row.of not in networks:
                raise ValueRuleError(f"methods.{row.key}.of", row.of, f"the networks are {networks}")

    @classmethod
    def parse(cls, plain: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Methods:
        """Build from plain dictionaries, group -> key -> row.

        Raises:
            ValueRuleError: a field of a row is missing or unknown, or breaks its rule.
        """
        check_mapping("methods", plain)
        rows: list[Method] = []
        for group, own in plain.items():
            check_mapping(f"methods.{group}", own)
            for key, row in own.items():
                path = f"methods.{group}.{key}"
                check_mapping(path, row)
                rows.append(parsed(Method, {**row, "key": key}, path))
        return cls(tuple(rows))

    def __iter__(self) -> Iterator[Method]:
        return iter(self.rows)

    def __getitem__(self, key: str) -> Method:
        found = {row.key: row for row in self.rows}
        if key not in found:
            raise ValueRuleError("methods", key, f"known methods are {list(found)}")
        return found[key]

    @property
    def reference(self) -> Method:
        """The strongest simple method, which others are compared with window by window."""
        return next(row for row in self.rows if row.role == "reference")

    @property
    def simple(self) -> list[Method]:
        """The simple methods, which every other one must beat; the first goes straight on."""
        return [row for row in self.rows if row.role in ("baseline", "reference")]

    @property
    def networks(self) -> list[Method]:
        """The learned methods, but for ablations."""
        return [row for row in self.rows if row.role == "network"]

    @property
    def main(self) -> Method:
        """The method that reports are about."""
        return self.networks[-1]

    @property
    def ablations(self) -> list[tuple[Method, Method]]:
        """Each ablation with the network that it is compared with."""
        return [(row, self[row.of]) for row in self.rows if row.of]

    def ordered(self, keys: Iterable[str]) -> list[str]:
        """Keys in the order of display; unknown ones last, by name."""
        given = set(keys)
        known = [row.key for row in self.rows if row.key in given]
        return known + sorted(given - set(known))

    def applied_to(self, where: str) -> list[Method]:
        """The methods for one kind of test set.

        Raises:
            ValueRuleError: the reference is not among them.
        """
        if where not in self.reference.where:
            rule = f"differences are taken to this method, so that {where} must be in it"
            raise ValueRuleError(f"methods.{self.reference.key}.where", self.reference.where, rule)
        return [row for row in self.rows if where in row.where]
