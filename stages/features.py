"""features_simulated, features_real: tracked states, grids and targets of a set's scenes, as Parquet."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from omegaconf import DictConfig

from pedpred.config import SETS, configured, plain, row, stage, stage_key
from pedpred.errors import ConfigError
from pedpred.features import FeatureSettings, extract_blocks
from pedpred.scenes import VARIANTS
from pedpred.simulation.sensor import SensorSettings, apply_sensor
from pedpred.storage.scenes import read_scene, scene_folders
from pedpred.storage.shards import write_manifest, write_shard
from pedpred.tracking import KalmanSettings, follow, resampled
from pedpred.workers import in_parallel


@dataclass(frozen=True)
class Processing:
    """What happens to all scenes of a set: sensor faults, tracking, extraction.

    Attributes:
        sensor: faults between people and tracker.
        kind: of the tracker, "truth" or "kalman".
        kalman: parameters of the filter; None for "truth".
        standstill_mps: below this speed the heading is held, m/s.
        sizes: of the features.
    """

    sensor: SensorSettings
    kind: str
    kalman: KalmanSettings | None
    standstill_mps: float
    sizes: FeatureSettings


def features_into(out: Path, folder: Path, variant: str, how: Processing) -> None:
    """Write the shard of one scene or of a variant of it. A job of one worker."""
    real, sizes = read_scene(folder), how.sizes
    if variant:
        real = replace(VARIANTS[variant](real), name=shard_name(folder, variant))
    scene, kind, kalman = real, how.kind, how.kalman
    if sizes.noncausal:
        scene, kind, kalman = resampled(real, sizes.dt_s, sizes.lost_after_s), "truth", None
    elif how.sensor != SensorSettings():
        rng = np.random.default_rng([how.sensor.seed, zlib.crc32(real.name.encode())])
        scene = apply_sensor(real, how.sensor, rng)
    tracks = follow(scene.trajectories, kind, kalman, how.standstill_mps, sizes.lost_after_s)
    write_shard(extract_blocks(scene, tracks, sizes, truth=real.trajectories), out, scene.name)


def shard_name(folder: Path, variant: str) -> str:
    """Return the name of a scene's shard, or of its variant's."""
    return f"{folder.name}_{variant}" if variant else folder.name


@stage
def main(cfg: DictConfig) -> None:
    """Read data/scenes/<kind>/<name>, write data/features/<kind>/<name>, several scenes at once."""
    key, rows = stage_key(cfg), SETS[cfg.kind]
    out = Path(cfg.get("out", f"data/features/{cfg.kind}/{key}"))
    source, protocol, sizes = plain(cfg[rows][key]), plain(cfg.protocol), plain(cfg.features)
    if unknown := sorted(set(source["variants"]) - set(VARIANTS)):
        raise ConfigError(f"{rows}.{key}.variants", unknown, f"choose among {', '.join(VARIANTS)}")
    tracker = row(cfg, "trackers", source["tracker"])
    kind, standstill_mps = tracker.pop("kind"), sizes.pop("standstill_mps")
    if kind == "truth":  # true states need no differences, so inputs cannot leak the future
        protocol["noncausal"] = False
    phase_offsets = 1 if protocol["noncausal"] else source["phase_offsets"]  # resampled tracks have one phase
    with configured(f"trackers.{source['tracker']}"):
        kalman = KalmanSettings(**tracker) if tracker else None
    with configured(f"sensors.{source['sensor']}"):
        sensor = SensorSettings(**row(cfg, "sensors", source["sensor"]))
    with configured("features"):
        settings = FeatureSettings(**protocol, **sizes, phase_offsets=phase_offsets)
    how = Processing(sensor, kind, kalman, standstill_mps, settings)
    folders = scene_folders(Path("data/scenes", cfg.kind, key))
    seen = [(folder, variant) for folder in folders for variant in ("", *source["variants"])]
    tasks = [(out, *one, how) for one in seen]
    in_parallel(features_into, tasks, f"features of {key}", "scene")
    write_manifest(out, settings, {shard_name(*one): one[0] for one in seen})


if __name__ == "__main__":
    main()
