"""How simulated worlds and the sensors in them vary: files, since nobody overrides single ranges of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pedpred.config import configured, part, read_table
from pedpred.settings import In, Settings, load
from pedpred.simulation.worlds import SensingSettings, WorldSettings


@dataclass(frozen=True)
class WorldFiles(Settings):
    """Where these are written.

    Attributes:
        ranges: file of `WorldSettings`.
        sensing: file of `SensingSettings`.
        duration_s: of every world; 0: that of its kind.
    """

    ranges: str
    sensing: str
    duration_s: Annotated[float, In("[0, 1000000]")] = 0.0


def worlds_of(cfg: Mapping[str, Any]) -> tuple[WorldSettings, SensingSettings]:
    """Read the ranges of worlds and of sensors.

    Raises:
        ConfigError: a file is missing, or a value breaks its rule; it names file and key.
    """
    with configured("worlds"):
        files = load(WorldFiles, part(cfg, "worlds"))
    ranges, sensing = read_table(files.ranges), read_table(files.sensing)
    if files.duration_s:
        for kind in ranges.values():
            if isinstance(kind, dict) and "duration_s" in kind:
                kind["duration_s"] = files.duration_s
    with configured(files.ranges):
        worlds: WorldSettings = load(WorldSettings, ranges)
    with configured(files.sensing):
        return worlds, load(SensingSettings, sensing)
