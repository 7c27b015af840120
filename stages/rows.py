"""rows@features-kind: what networks read and are trained on, of simulated or real people, as Parquet.

Networks with a memory read all steps of all tracks, others single instants: `ModelFeatures.has_memory`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import SETS, configured, one_of, plain, row, stage, stage_key
from pedpred.features import extract_blocks
from pedpred.features.perception import Perception, perceived
from pedpred.models.features import RowFormat
from pedpred.scenes import VARIANTS
from pedpred.sequences import SequenceSets, collect_world_steps
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
from pedpred.storage.manifests import write_about
from pedpred.storage.scenes import read_scene, scene_folders
from pedpred.storage.shards import FEATURE_SCHEMA, columns_of, write_manifest, write_shard
from pedpred.storage.situations import situation_columns, write_situations, write_situations_manifest
from pedpred.workers import in_parallel
from stages.perception import features_of, perception_of, protocol_of, variants_of
from stages.worlds import worlds_of

SCENES = Path("data/scenes")


@dataclass(frozen=True)
class RowSet:
    """A folder of rows.

    Attributes:
        tasks: function and arguments of what writes each of its files; jobs of one worker each.
        finish: writes the manifest.
    """

    tasks: list[tuple[Any, ...]]
    finish: Callable[[], None]


def recipe_of(cfg: DictConfig, model: str) -> Recipe:
    """Read how tracked people and their future become rows of a model's inputs."""
    protocol, how = protocol_of(cfg)
    made_with = RowFormat(
        replace(protocol, noncausal=False), model, features_of(cfg, model)
    )  # true states need no differences
    with configured("situations.rows"):
        return Recipe(load(RowSettings, plain(cfg.situations.rows)), made_with, how.standstill_mps)


def steps_of_scenes(cfg: DictConfig, model: str, kind: str, key: str, out: Path) -> RowSet:
    """All steps of the scenes of a set and of their variants, as its sensor and tracker perceive them.

    Nobody is trained on stand-ins.
    """
    source = cfg[SETS[kind]][key]
    variants = variants_of(f"{SETS[kind]}.{key}", source)
    how, protocol = perception_of(cfg, source)
    made_with, phase_offsets = RowFormat(protocol, model, features_of(cfg, model)), 1
    if not protocol.noncausal:  # resampled tracks have one phase
        phase_offsets = source.phase_offsets
    folders = [path for path in scene_folders(SCENES / kind / key) if read_scene(path).stand_in is None]
    seen = [(folder, each) for folder in folders for each in ("", *variants)]
    tasks = [(write_steps, out, *one, how, made_with, phase_offsets) for one in seen]
    shards = {shard_name(*one): one[0] for one in seen}
    return RowSet(tasks, lambda: write_manifest(out, made_with, shards))


def write_steps(
    out: Path, folder: Path, variant: str, how: Perception, made_with: RowFormat, phase_offsets: int
) -> None:
    """Write the steps of one scene or of a variant of it."""
    real = read_scene(folder)
    if variant:
        real = replace(VARIANTS[variant](real), name=shard_name(folder, variant))
    protocol, features = made_with.protocol, made_with.features
    scene, tracks = perceived(real, how, protocol)
    blocks = extract_blocks(
        scene, tracks, protocol, features, truth=real.trajectories, phase_offsets=phase_offsets
    )
    write_shard(blocks, out, scene.name)


def shard_name(folder: Path, variant: str) -> str:
    """Return the name of a scene's shard, or of its variant's."""
    return f"{folder.name}_{variant}" if variant else folder.name


def steps_of_worlds(cfg: DictConfig, model: str, out: Path) -> RowSet:
    """All steps of simulated worlds through random sensors."""
    with configured("sequences"):
        sets = load(SequenceSets, plain(cfg.sequences))
    worlds, recipe = worlds_of(cfg), recipe_of(cfg, model)
    todo = [(kind, number) for kind, count in sets.worlds.items() for number in range(count)]
    tasks = [(write_world_steps, out, *world, *worlds, recipe) for world in todo]
    names = sorted(f"{kind}_{number:03}" for kind, number in todo)
    shards = {name: {"scene_sha256": hashlib.sha256(name.encode()).hexdigest()} for name in names}
    made_with = recipe.made_with
    return RowSet(
        tasks,
        lambda: write_about(out, FEATURE_SCHEMA, made_with, columns_of(made_with), {"shards": shards}),
    )


def write_world_steps(
    out: Path, kind: str, number: int, worlds: WorldSettings, sensing: SensingSettings, recipe: Recipe
) -> None:
    """Write the steps of one world."""
    write_shard(collect_world_steps(kind, number, worlds, sensing, recipe), out, f"{kind}_{number:03}")


def instants(out: Path, recipe: Recipe, tasks: list[tuple[Any, ...]]) -> RowSet:
    """Rows of single instants.

    Args:
        out: folder of the set.
        recipe: of the rows.
        tasks: name of a file, and what makes its rows with which arguments.
    """
    names = [name for name, *_ in tasks]
    writing = [(write_instants, out, recipe.made_with, *task) for task in tasks]
    return RowSet(writing, lambda: write_situations_manifest(out, recipe.made_with, names))


def write_instants(
    out: Path, made_with: RowFormat, name: str, make: Callable[..., Rows], *arguments: Any
) -> None:
    """Write the rows of one world, scene or viewing."""
    write_situations(make(*arguments), out, name, situation_columns(made_with))


def instants_of_worlds(cfg: DictConfig, model: str, key: str, out: Path) -> RowSet:
    """Instants of worlds, or of simulated scenes."""
    with configured(f"situations.simulated.{key}"):
        chosen = load(SimulatedSet, plain(cfg.situations.simulated[key]))
    (worlds, sensing), recipe = worlds_of(cfg), recipe_of(cfg, model)
    tasks: list[tuple[Any, ...]]
    if chosen.kind == "arrangement":
        folders = scene_folders(Path(chosen.input))[: chosen.worlds]
        tasks = [(folder.name, scene_rows, folder, chosen, sensing, recipe) for folder in folders]
    else:
        numbers = range(chosen.worlds)
        tasks = [(f"{key}_{n:03}", collect_world_rows, n, chosen, worlds, sensing, recipe) for n in numbers]
    return instants(out, recipe, tasks)


def scene_rows(folder: Path, *arguments: Any) -> Rows:
    """Read a simulated scene and make its rows."""
    return collect_scene_rows(read_scene(folder), *arguments)


def instants_of_place(cfg: DictConfig, model: str, key: str, out: Path) -> RowSet:
    """Instants of the viewings of a place; none where no real people were recorded, nor of stand-ins."""
    sensor, recipe = cfg.places[key].sensor, recipe_of(cfg, model)
    with configured(f"sensors.{sensor}"):
        rate_hz = load(SensorSettings, row(cfg, "sensors", sensor)).rate_hz
    with configured("situations.real"):
        settings = load(ViewingSettings, plain(cfg.situations.real))
    folder = SCENES / "real" / key
    scene = read_scene(folder)
    numbers = range(0 if scene.unavailable or scene.stand_in else settings.viewings)
    tasks = [(f"{key}_{n}", viewed_rows, folder, n, rate_hz, settings, recipe) for n in numbers]
    return instants(out, recipe, tasks)


def viewed_rows(folder: Path, number: int, *arguments: Any) -> Rows:
    """Read a recording and make the rows of one viewing."""
    return collect_viewing_rows(number, read_scene(folder), *arguments)


def sets_of(cfg: DictConfig, model: str, kind: str, out: Path) -> Iterator[RowSet]:
    """All sets of a kind."""
    if features_of(cfg, model).has_memory:
        for key in cfg.sequences.scenes if kind == "simulated" else cfg.places:
            yield steps_of_scenes(cfg, model, kind, key, out / key)
        if kind == "simulated":
            yield steps_of_worlds(cfg, model, out / "worlds")
    elif kind == "simulated":
        for key in cfg.situations.simulated:
            yield instants_of_worlds(cfg, model, key, out / key)
    else:
        for key in cfg.places:
            yield instants_of_place(cfg, model, key, out / key)


@stage("name", "kind")
def main(cfg: DictConfig) -> None:
    """Write data/rows/<name>/<kind>, a folder per set; `name` is a row of conf/features."""
    model, kind = stage_key(cfg), one_of("kind", cfg.kind, {kind: kind for kind in SETS})
    one_of("name", model, cfg.features)
    out = Path(cfg.get("out") or f"data/rows/{model}/{kind}")
    sets = list(sets_of(cfg, model, kind, out))
    out.mkdir(parents=True, exist_ok=True)
    in_parallel(call, [task for each in sets for task in each.tasks], f"rows of {model}, {kind}", "file")
    for each in sets:
        each.finish()


def call(job: Callable[..., None], *arguments: Any) -> None:
    """A job of one worker."""
    job(*arguments)


if __name__ == "__main__":
    main()
