"""features_simulated, features_real: tracked states, grids and targets of a set's scenes, as Parquet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import SETS, configured, one_of, part, row, stage, stage_key
from pedpred.errors import ConfigError
from pedpred.features import ForecastProtocol, ModelFeatures, extract_blocks
from pedpred.features.perception import Following, Perception, parse_tracker, perceived
from pedpred.models.features import RowFormat, parse_features
from pedpred.scenes import VARIANTS
from pedpred.settings import load, load_together
from pedpred.simulation.sensor import SensorSettings
from pedpred.storage.scenes import read_scene, scene_folders
from pedpred.storage.shards import write_manifest, write_shard
from pedpred.tracking import KalmanBank, KalmanSettings
from pedpred.workers import in_parallel

_MODEL = "lstm"
"""Whose inputs these are."""


def perception_of(cfg: DictConfig, source: DictConfig) -> tuple[Perception, ForecastProtocol]:
    """Build how people are perceived in the scenes of a row of simulations or places, and the protocol."""
    with configured(f"trackers.{source.tracker}"):
        kalman = parse_tracker(row(cfg, "trackers", source.tracker))
    with configured(f"sensors.{source.sensor}"):
        sensor = load(SensorSettings, row(cfg, "sensors", source.sensor))
    protocol, how = protocol_of(cfg)
    if kalman is None:  # true states need no differences, so inputs cannot leak the future
        return Perception(None, how.standstill_mps, sensor), replace(protocol, noncausal=False)
    return Perception(KalmanBank.around(kalman, how.learn_noise), how.standstill_mps, sensor), protocol


def protocol_of(cfg: Mapping[str, Any]) -> tuple[ForecastProtocol, Following]:
    """Read what all forecasts have in common, and how people are followed."""
    with configured("protocol"):
        protocol, how = load_together([ForecastProtocol, Following], part(cfg, "protocol"))
    return protocol, how


def features_of(cfg: Mapping[str, Any], model: str) -> ModelFeatures:
    """Read the sizes of a model's inputs."""
    with configured(f"features.{model}"):
        return parse_features(model, part(cfg, "features", model))


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


def features_into(
    out: Path, folder: Path, variant: str, how: Perception, made_with: RowFormat, phase_offsets: int
) -> None:
    """Write the shard of one scene or of a variant of it. A job of one worker."""
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


@stage
def main(cfg: DictConfig) -> None:
    """Read data/scenes/<kind>/<name>, write data/features/<kind>/<name>, several scenes at once."""
    key, rows = stage_key(cfg), one_of("kind", cfg.kind, SETS)
    out, source = Path(cfg.get("out", f"data/features/{cfg.kind}/{key}")), cfg[rows][key]
    variants = variants_of(f"{rows}.{key}", source)
    how, protocol = perception_of(cfg, source)
    made_with, phase_offsets = RowFormat(protocol, _MODEL, features_of(cfg, _MODEL)), 1
    if not protocol.noncausal:  # resampled tracks have one phase
        phase_offsets = source.phase_offsets
    folders = scene_folders(Path("data/scenes", cfg.kind, key))
    seen = [(folder, variant) for folder in folders for variant in ("", *variants)]
    tasks = [(out, *one, how, made_with, phase_offsets) for one in seen]
    in_parallel(features_into, tasks, f"features of {key}", "scene")
    write_manifest(out, made_with, {shard_name(*one): one[0] for one in seen})


if __name__ == "__main__":
    main()
