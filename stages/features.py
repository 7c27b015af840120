"""features_simulated, features_real: tracked states, grids and targets of a set's scenes, as Parquet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import SETS, configured, one_of, part, row, stage, stage_key
from pedpred.errors import ConfigError, ValueRuleError
from pedpred.features import FeatureSettings, extract_blocks
from pedpred.features.perception import Perception, Standstill, parse_tracker, perceived
from pedpred.scenes import VARIANTS
from pedpred.simulation.fields import parsed, parsed_together
from pedpred.simulation.sensor import SensorSettings
from pedpred.storage.scenes import read_scene, scene_folders
from pedpred.storage.shards import write_manifest, write_shard
from pedpred.tracking import KalmanSettings
from pedpred.workers import in_parallel


def perception_of(cfg: DictConfig, source: DictConfig) -> tuple[Perception, FeatureSettings]:
    """Build how people are perceived in the scenes of a row of simulations or places, and sizes."""
    with configured(f"trackers.{source.tracker}"):
        kalman = parse_tracker(row(cfg, "trackers", source.tracker))
    with configured(f"sensors.{source.sensor}"):
        sensor = parsed(SensorSettings, row(cfg, "sensors", source.sensor))
    sizes, standstill_mps = sizes_of(cfg)
    if kalman is None:  # true states need no differences, so inputs cannot leak the future
        sizes = replace(sizes, noncausal=False)
    return Perception(kalman, standstill_mps, sensor), sizes


def sizes_of(cfg: Mapping[str, Any]) -> tuple[FeatureSettings, float]:
    """Read the sizes of inputs and forecasts, and the speed of standing people, m/s."""
    protocol, inputs = (part(cfg, key) for key in ("protocol", "features"))
    try:
        sizes, standstill = parsed_together([FeatureSettings, Standstill], protocol | inputs)
    except ValueRuleError as error:
        group = "protocol" if error.field in protocol else "features"
        raise ConfigError(f"{group}.{error.field}", error.value, error.rule) from error
    return sizes, standstill.standstill_mps


def kalman_of(cfg: Mapping[str, Any], name: str) -> KalmanSettings:
    """Read a tracker's row.

    Raises:
        ConfigError: there is none, it breaks a rule, or it is no Kalman filter.
    """
    with configured(f"trackers.{name}"):
        kalman = parse_tracker(row(cfg, "trackers", name))
    if kalman is None:
        raise ConfigError(f"trackers.{name}.kind", "truth", "a Kalman filter is needed here")
    return kalman


def variants_of(key: str, source: DictConfig) -> list[str]:
    """Read the variants of a row of simulations or places.

    Raises:
        ConfigError: they are no list, or one of them is unknown.
    """
    if not isinstance(source.variants, Sequence) or isinstance(source.variants, str):
        raise ConfigError(f"{key}.variants", source.variants, "a list is needed")
    for variant in source.variants:
        one_of(f"{key}.variants", variant, VARIANTS)
    return list(source.variants)


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
    variants = variants_of(f"{rows}.{key}", source)
    how, sizes = perception_of(cfg, source)
    if not sizes.noncausal:  # resampled tracks have one phase
        with configured(f"{rows}.{key}"):
            sizes = replace(sizes, phase_offsets=source.phase_offsets)
    folders = scene_folders(Path("data/scenes", cfg.kind, key))
    seen = [(folder, variant) for folder in folders for variant in ("", *variants)]
    tasks = [(out, *one, how, sizes) for one in seen]
    in_parallel(features_into, tasks, f"features of {key}", "scene")
    write_manifest(out, sizes, {shard_name(*one): one[0] for one in seen})


if __name__ == "__main__":
    main()
