"""How simulated worlds and the sensors in them vary: files, since nobody overrides single ranges of them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from pedpred.config import configured, part
from pedpred.errors import ConfigError
from pedpred.files import read_yaml
from pedpred.settings import load
from pedpred.simulation.worlds import SensingSettings, WorldSettings


def worlds_of(cfg: Mapping[str, Any]) -> tuple[WorldSettings, SensingSettings]:
    """Read the ranges of worlds and of sensors.

    Raises:
        ConfigError: a file is missing, or a value breaks its rule; it names file and key.
    """
    row = part(cfg, "worlds")
    tables = {key: read_table(row, key) for key in ("ranges", "sensing")}
    if row["duration_s"] is not None:
        for kind in tables["ranges"].values():
            if isinstance(kind, dict) and "duration_s" in kind:
                kind["duration_s"] = row["duration_s"]
    with configured(row["ranges"]):
        worlds: WorldSettings = load(WorldSettings, tables["ranges"])
    with configured(row["sensing"]):
        return worlds, load(SensingSettings, tables["sensing"])


def read_table(row: Mapping[str, Any], key: str) -> dict[str, Any]:
    """Read the file that a key of `worlds` names."""
    return read_yaml(Path(row[key]), partial(ConfigError, f"worlds.{key}", row[key]))
