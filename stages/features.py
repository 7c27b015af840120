"""features_simulated, features_real: tracked states, grids and targets of a set's scenes, as Parquet."""

from __future__ import annotations

import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
from omegaconf import DictConfig

from pedpred.config import SETS, plain, row, stage, stage_key
from pedpred.errors import ConfigError
from pedpred.features import FeatureSettings, extract_blocks
from pedpred.scenes import VARIANTS
from pedpred.simulation.sensor import SensorSettings, apply_sensor
from pedpred.storage.scenes import read_scene, scene_folders
from pedpred.storage.shards import write_manifest, write_shard
from pedpred.tracking import KalmanSettings, follow, resampled
from pedpred.workers import in_parallel


def features_into(
    out: Path, folder: Path, variant: str, settings: FeatureSettings, source: dict, standstill_mps: float
) -> None:
    """One worker's job: the shard of one scene or of a variant, as its protocol and its sensor show it."""
    real = read_scene(folder)
    if variant:
        real = replace(VARIANTS[variant](real), name=shard_name(folder, variant))
    tracker, sensor = dict(source["tracker"]), SensorSettings(**source["sensor"])
    scene = real
    if settings.noncausal:
        scene, tracker = resampled(real, settings.dt_s, settings.lost_after_s), {"kind": "truth"}
    elif sensor != SensorSettings():
        scene = apply_sensor(
            real, sensor, np.random.default_rng([sensor.seed, zlib.crc32(real.name.encode())])
        )
    kind = tracker.pop("kind")
    kalman = KalmanSettings(**tracker) if tracker else None
    tracks = follow(scene.trajectories, kind, kalman, standstill_mps, settings.lost_after_s)
    write_shard(extract_blocks(scene, tracks, settings, truth=real.trajectories), out, scene.name)


def shard_name(folder: Path, variant: str) -> str:
    """Name of a scene's shard, or of its variant's."""
    return f"{folder.name}_{variant}" if variant else folder.name


@stage
def main(cfg: DictConfig) -> None:
    """Read data/scenes/<kind>/<name>, write data/features/<kind>/<name>, several scenes at once."""
    key, rows = stage_key(cfg), SETS[cfg.kind]
    out = Path(cfg.get("out", f"data/features/{cfg.kind}/{key}"))
    groups = plain(cfg)
    standstill_mps = groups["features"].pop("standstill_mps")
    source = groups[rows][key]
    source["tracker"] = row(cfg, "trackers", source["tracker"])
    source["sensor"] = row(cfg, "sensors", source["sensor"])
    true = source["tracker"]["kind"] == "truth"  # states need no differences, so that none can leak
    protocol = groups["protocol"] | {"noncausal": groups["protocol"]["noncausal"] and not true}
    phase_offsets = 1 if protocol["noncausal"] else source["phase_offsets"]  # resampled tracks have one clock
    settings = FeatureSettings(**protocol, **groups["features"], phase_offsets=phase_offsets)
    folders = scene_folders(Path("data/scenes", cfg.kind, key))
    if unknown := sorted(set(source["variants"]) - set(VARIANTS)):
        raise ConfigError(f"{rows}.{key}.variants", unknown, f"choose among {', '.join(VARIANTS)}")
    seen = [(folder, variant) for folder in folders for variant in ("", *source["variants"])]
    tasks = [(out, *one, settings, source, standstill_mps) for one in seen]
    in_parallel(features_into, tasks, f"features of {key}", "scene")
    write_manifest(out, settings, {shard_name(*one): one[0] for one in seen})


if __name__ == "__main__":
    main()
