"""situations_simulated, situations_real: training rows of networks without memory, as Parquet."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import configured, one_of, plain, row, stage, stage_key
from pedpred.features import StoredColumn
from pedpred.models.features import RowFormat
from pedpred.settings import load
from pedpred.simulation.sensor import SensorSettings
from pedpred.simulation.worlds import SensingSettings, WorldSettings
from pedpred.situations import (
    Recipe,
    Rows,
    RowSettings,
    SimulatedSet,
    ViewingSettings,
    collect_scene_rows,
    collect_viewing_rows,
    collect_world_rows,
)
from pedpred.storage.scenes import read_scene, scene_folders
from pedpred.storage.situations import situation_columns, write_situations, write_situations_manifest
from pedpred.workers import in_parallel
from stages.features import features_of, protocol_of

_MODEL = "mixture"
"""Whose inputs these are."""

Job = tuple[str, Callable[..., Rows], tuple[Any, ...]]
"""Name of a shard, and what makes its rows."""


def rows_into(
    out: Path, name: str, columns: Mapping[str, StoredColumn], make: Callable[..., Rows], *arguments: Any
) -> None:
    """Write one shard. A job of one worker."""
    write_situations(make(*arguments), out, name, columns)


def simulated_jobs(cfg: DictConfig, key: str, recipe: Recipe) -> list[Job]:
    """One job per world, or per scene of another set."""
    with configured(f"situations.simulated.{key}"):
        chosen = load(SimulatedSet, plain(cfg.situations.simulated[key]))
    with configured("worlds"):
        worlds = load(WorldSettings, plain(cfg.worlds))
    with configured("sensing"):
        sensing = load(SensingSettings, plain(cfg.sensing))
    if chosen.kind == "arrangement":
        folders = scene_folders(Path(chosen.input))[: chosen.worlds]
        return [(folder.name, recorded_rows, (folder, chosen, sensing, recipe)) for folder in folders]
    numbers = range(chosen.worlds)
    return [(f"{key}_{n:03}", collect_world_rows, (n, chosen, worlds, sensing, recipe)) for n in numbers]


def recorded_rows(folder: Path, *arguments: Any) -> Rows:
    """Read a simulated scene and make its rows."""
    return collect_scene_rows(read_scene(folder), *arguments)


def real_jobs(cfg: DictConfig, key: str, recipe: Recipe) -> list[Job]:
    """One job per viewing of a place; none where no real people were recorded: nobody trains on stand-ins."""
    sensor = cfg.places[key].sensor
    with configured(f"sensors.{sensor}"):
        rate_hz = load(SensorSettings, row(cfg, "sensors", sensor)).rate_hz
    with configured("situations.real"):
        settings = load(ViewingSettings, plain(cfg.situations.real))
    folder = Path("data/scenes/real", key)
    scene = read_scene(folder)
    numbers = range(0 if scene.unavailable or scene.stand_in else settings.viewings)
    return [(f"{key}_{n}", viewed_rows, (folder, n, rate_hz, settings, recipe)) for n in numbers]


def viewed_rows(folder: Path, number: int, *arguments: Any) -> Rows:
    """Read a recording and make the rows of one viewing."""
    return collect_viewing_rows(number, read_scene(folder), *arguments)


@stage
def main(cfg: DictConfig) -> None:
    """Write data/situations/<kind>/<name>, several worlds or viewings at once."""
    key, jobs_of = stage_key(cfg), one_of("kind", cfg.kind, {"simulated": simulated_jobs, "real": real_jobs})
    out = Path(cfg.get("out") or f"data/situations/{cfg.kind}/{key}")
    protocol, how = protocol_of(cfg)
    causal = replace(protocol, noncausal=False)  # true states need no differences
    made_with = RowFormat(causal, _MODEL, features_of(cfg, _MODEL))
    with configured("situations.rows"):
        recipe = Recipe(load(RowSettings, plain(cfg.situations.rows)), made_with, how.standstill_mps)
    jobs = jobs_of(cfg, key, recipe)
    columns = situation_columns(made_with)
    tasks = [(out, name, columns, make, *rest) for name, make, rest in jobs]
    in_parallel(rows_into, tasks, f"rows of {key}", "world")
    write_situations_manifest(out, made_with, [name for name, _, _ in jobs])


if __name__ == "__main__":
    main()
