"""features_simulated, features_real: tracked states, grids and targets of a set's scenes, as Parquet."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import SETS, configured, one_of, plain, row, stage, stage_key
from pedpred.errors import ConfigError
from pedpred.features import FeatureSettings, extract_blocks
from pedpred.features.perception import Perception, parse_tracker, perceived
from pedpred.scenes import VARIANTS
from pedpred.simulation.sensor import SensorSettings
from pedpred.storage.scenes import read_scene, scene_folders
from pedpred.storage.shards import write_manifest, write_shard
from pedpred.workers import in_parallel


def perception_of(cfg: DictConfig, source: DictConfig) -> tuple[Perception, FeatureSettings]:
    """Build how people are perceived in the scenes of a row of simulations or places, and sizes."""
    with configured(f"trackers.{source.tracker}"):
        kalman = parse_tracker(row(cfg, "trackers", source.tracker))
    with configured(f"sensors.{source.sensor}"):
        sensor = SensorSettings(**row(cfg, "sensors", source.sensor))
    sizes = plain(cfg.protocol) | plain(cfg.features)
    how = Perception(kalman, sizes.pop("standstill_mps"), sensor)
    if kalman is None:  # true states need no differences, so inputs cannot leak the future
        sizes["noncausal"] = False
    with configured("features"):
        return how, FeatureSettings(**sizes)


def features_into(out: Path, folder: Path, variant: str, how: Perception, sizes: FeatureSettings) -> None:
    """Write the shard of one scene or of a variant of it. A job of one worker."""
    real = read_scene(folder)
    if variant:
        real = replace(VARIANTS[variant](real), name=shard_name(folder, variant))
    scene, tracks = perceived(real, how, sizes)
    write_shard(extract_blocks(scene, tracks, sizes, truth=real.trajectories), out, scene.name)


def shard_name(folder: Path, variant: str) -> str:
    """Return the name of a scene's shard, or of its variant's."""
    return f"{folder.name}_{variant}" if variant else folder.name


@stage
def main(cfg: DictConfig) -> None:
    """Read data/scenes/<kind>/<name>, write data/features/<kind>/<name>, several scenes at once."""
    key, rows = stage_key(cfg), one_of("kind", cfg.kind, SETS)
    out, source = Path(cfg.get("out", f"data/features/{cfg.kind}/{key}")), cfg[rows][key]
    if unknown := sorted(set(source.variants) - set(VARIANTS)):
        raise ConfigError(f"{rows}.{key}.variants", unknown, f"choose among {', '.join(VARIANTS)}")
    how, sizes = perception_of(cfg, source)
    if not sizes.noncausal:  # resampled tracks have one phase
        with configured(f"{rows}.{key}"):
            sizes = replace(sizes, phase_offsets=source.phase_offsets)
    folders = scene_folders(Path("data/scenes", cfg.kind, key))
    seen = [(folder, variant) for folder in folders for variant in ("", *source.variants)]
    tasks = [(out, *one, how, sizes) for one in seen]
    in_parallel(features_into, tasks, f"features of {key}", "scene")
    write_manifest(out, sizes, {shard_name(*one): one[0] for one in seen})


if __name__ == "__main__":
    main()
