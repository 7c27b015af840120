"""How mirrors are written in a row."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from pedpred.errors import ValueRuleError
from pedpred.fields import check_ranges


@dataclass(frozen=True)
class MirrorRow:
    """`pedpred.sources.mirrors.Mirrors` as they are written.

    Attributes:
        folders: see there.
        archives: see there.
        timeout_s: see there.
        sha256sums: lines as `sha256sum` prints them.
        optional: see there.
        inside: see there.
    """

    folders: tuple[str, ...]
    archives: tuple[str, ...]
    timeout_s: float
    sha256sums: tuple[str, ...]
    optional: tuple[str, ...] = ()
    inside: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_ranges(self, {"timeout_s": "(0, 3600]"})
        for line in self.sha256sums:
            if len(line.split(maxsplit=1)) != 2:
                raise ValueRuleError("sha256sums", line, "a line holds a sum and the path of a file")
