"""simulate@simulation: the arrangements of one simulated set, one scene folder each."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import configured, one_of, plain, row, stage, stage_key
from pedpred.errors import ConfigError
from pedpred.files import read_yaml
from pedpred.settings import load, load_together
from pedpred.simulation.arrangements import Arrangement, arrangements, parse_layouts, simulate_arrangement
from pedpred.simulation.clutter import ClutterSettings
from pedpred.simulation.settings import SimulationSettings, SocialForceSettings, social_force_settings
from pedpred.storage.scenes import write_scene
from pedpred.workers import in_parallel
from stages.sets import SetTracking

LAYOUTS = Path(__file__).resolve().parents[1] / "conf/layouts"
"""Drawn rooms, a file each, which are no parameters: a room is another one or it is not."""


def read_layouts(names: Iterable[str]) -> dict[str, Any]:
    """Read drawn rooms as they are written, by name; a `ConfigError` if there is no such room."""
    files = {file.stem: file for file in sorted(LAYOUTS.glob("*.yaml"))}
    chosen = {name: one_of("layouts", name, files) for name in names}
    return {
        name: read_yaml(file, partial(ConfigError, f"layouts.{name}", str(file)))
        for name, file in chosen.items()
    }


def simulate_into(out: Path, arrangement: Arrangement, settings: SocialForceSettings) -> None:
    """One worker's job: simulate one arrangement and write it."""
    write_scene(simulate_arrangement(arrangement, settings), out / arrangement.name)


@stage("name")
def main(cfg: DictConfig) -> None:
    """Write data/scenes/simulated/<name>, several arrangements at once (see `pedpred.workers`)."""
    key = stage_key(cfg)
    out = Path(cfg.get("out") or f"data/scenes/simulated/{key}")
    simulation = plain(cfg.simulations[key])
    with configured(f"social_forces.{simulation['social_force']}"):
        settings = social_force_settings(row(cfg, "social_forces", simulation["social_force"]))
    with configured("clutter"):
        clutter = load(ClutterSettings, plain(cfg.clutter))
    with configured(f"simulations.{key}"):
        data_set, _ = load_together([SimulationSettings, SetTracking], simulation)
    with configured("layouts"):
        layouts = parse_layouts(read_layouts(data_set.drawn), data_set.drawn, settings)
    with configured(f"simulations.{key}"):
        todo = arrangements(data_set, layouts, clutter, settings)
    tasks = [(out, arrangement, settings) for arrangement in todo]
    in_parallel(simulate_into, tasks, f"simulate {key}", "room")


if __name__ == "__main__":
    main()
