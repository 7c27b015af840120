"""sequences: steps of simulated worlds through random sensors, for networks with a memory."""

import hashlib
from dataclasses import replace
from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import configured, plain, stage
from pedpred.models.features import RowFormat
from pedpred.sequences import SequenceSets, collect_world_steps
from pedpred.settings import load
from pedpred.simulation.worlds import SensingSettings, WorldSettings
from pedpred.situations import Recipe, RowSettings
from pedpred.storage.manifests import write_about
from pedpred.storage.shards import FEATURE_SCHEMA, columns_of, write_shard
from pedpred.workers import in_parallel
from stages.features import features_of, protocol_of

_MODEL = "lstm"
"""Whose inputs these are."""


def steps_into(
    out: Path, kind: str, number: int, worlds: WorldSettings, sensing: SensingSettings, recipe: Recipe
) -> None:
    """Write the shard of one world. A job of one worker."""
    write_shard(collect_world_steps(kind, number, worlds, sensing, recipe), out, f"{kind}_{number:03}")


@stage
def main(cfg: DictConfig) -> None:
    """Write data/features/simulated/worlds, several worlds at once."""
    out = Path(cfg.get("out") or "data/features/simulated/worlds")
    with configured("sequences"):
        sets = load(SequenceSets, plain(cfg.sequences))
    with configured("worlds"):
        worlds = load(WorldSettings, plain(cfg.worlds))
    with configured("sensing"):
        sensing = load(SensingSettings, plain(cfg.sensing))
    protocol, how = protocol_of(cfg)
    made_with = RowFormat(replace(protocol, noncausal=False), _MODEL, features_of(cfg, _MODEL))
    with configured("situations.rows"):
        recipe = Recipe(load(RowSettings, plain(cfg.situations.rows)), made_with, how.standstill_mps)
    todo = [(kind, number) for kind, count in sets.worlds.items() for number in range(count)]
    in_parallel(steps_into, [(out, *world, worlds, sensing, recipe) for world in todo], "steps", "world")
    names = [f"{kind}_{number:03}" for kind, number in todo]
    shards = {name: {"scene_sha256": hashlib.sha256(name.encode()).hexdigest()} for name in sorted(names)}
    write_about(out, FEATURE_SCHEMA, made_with, columns_of(made_with), {"shards": shards})


if __name__ == "__main__":
    main()
