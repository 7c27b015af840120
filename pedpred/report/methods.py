"""How the compared methods are called, coloured and used in reports. Rows of `conf/report/methods.yaml`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pedpred.errors import ConfigError, ValueRuleError
from pedpred.files import read_yaml, translate_errors
from pedpred.settings import OneOf, Settings, check_mapping, load

ROLES = ("baseline", "oracle", "ablation", "network", "other")
"""baseline: simple and causal. oracle: knows the future goal. ablation: the network `of` without one of its
parts. network: a learned method; the last one listed is what reports are about. other: in tables and plots
only, as is a method without a row."""


@dataclass(frozen=True)
class Method(Settings):
    """One row.

    Attributes:
        key: its name in files, commands and configuration.
        label: name in reports.
        colour: of its lines, #RRGGBB.
        role: one of `ROLES`.
        of: key of the network that an ablation is compared with; empty for other roles.
    """

    key: str
    label: str
    colour: str = "#999999"
    role: Annotated[str, OneOf(ROLES)] = "other"
    of: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not re.fullmatch("#[0-9A-Fa-f]{6}", self.colour):
            raise ValueRuleError("colour", self.colour, "it must be #RRGGBB")
        if (self.role == "ablation") != bool(self.of):
            rule = "a method with the role ablation, and no other, names the network it is compared with"
            raise ValueRuleError("of", self.of, rule)

    @property
    def learned(self) -> bool:
        """Whether it has weights."""
        return self.role in ("ablation", "network")


@dataclass(frozen=True)
class Methods:
    """All rows, in the order of display; the method that reports are about comes last.

    Attributes:
        rows: of the methods.
        reference: the strongest simple method, which others are compared with window by window.
    """

    rows: tuple[Method, ...]
    reference: Method

    def __post_init__(self) -> None:
        networks = [row.key for row in self.networks]
        if not networks:
            raise ValueRuleError("methods", "network", "one method must have this role")
        if self.reference not in self.simple:
            raise ValueRuleError(
                "reference", self.reference.key, "it must be a method with the role baseline"
            )
        for row in self.rows:
            if row.of and row.of not in networks:
                raise ValueRuleError(f"methods.{row.key}.of", row.of, f"the networks are {networks}")

    @classmethod
    def parse(cls, plain: Mapping[str, Mapping[str, Any]], reference: str) -> Methods:
        """Build from plain dictionaries, key -> row.

        Args:
            plain: the rows.
            reference: key of the method that differences are taken to.

        Raises:
            ValueRuleError: a field of a row is missing or unknown, or breaks its rule.
        """
        check_mapping("methods", plain)
        rows: dict[str, Method] = {}
        for key, row in plain.items():
            check_mapping(f"methods.{key}", row)
            rows[key] = load(Method, {**row, "key": key}, f"methods.{key}")
        return cls(tuple(rows.values()), rows.get(reference, Method(reference, reference)))

    @classmethod
    def read(cls, folder: Path, reference: str) -> Methods:
        """Read them from the file of a project that says how methods are shown.

        Raises:
            ConfigError: the file is missing or damaged, or a row breaks a rule.
        """
        wording = partial(ConfigError, "methods", str(file := folder / "conf/report/methods.yaml"))
        rows = read_yaml(file, wording)
        with translate_errors(wording):
            return cls.parse(rows, reference)

    def __iter__(self) -> Iterator[Method]:
        return iter(self.rows)

    def __getitem__(self, key: str) -> Method:
        return next((row for row in self.rows if row.key == key), Method(key, key))

    @property
    def simple(self) -> list[Method]:
        """The simple methods, which every other one must beat; the first goes straight on."""
        return [row for row in self.rows if row.role == "baseline"]

    @property
    def best_simple(self) -> str:
        """In words, whichever of the simple methods is the best one somewhere."""
        *some, last = (row.label for row in self.simple)
        return f"the best of {', '.join(some)} and {last}" if some else last

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
        """Keys in the order of display; those without a row last, by name."""
        wanted = set(keys)
        known = [row.key for row in self.rows if row.key in wanted]
        return known + sorted(wanted - set(known))
