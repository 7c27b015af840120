"""evaluate_simulated, evaluate_real: every forecaster in every window of the test scenes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from omegaconf import DictConfig

from pedpred.baselines.kinematic import kalman_covariance
from pedpred.config import SETS, plain, row, stage
from pedpred.evaluation.compare import compare
from pedpred.evaluation.scores import Scores
from pedpred.evaluation.summary import figures
from pedpred.features import FeatureSettings
from pedpred.files import write_json
from pedpred.networks import NetworkForecaster, forecaster
from pedpred.storage.columns import write_columns
from pedpred.storage.scenes import read_scene, scene_folders
from pedpred.storage.shards import read_manifest, read_shard
from pedpred.tracking import KalmanSettings
from pedpred.workers import in_parallel


def kalman_spread(
    source: Mapping[str, Any], detection_dt_s: float, settings: FeatureSettings
) -> np.ndarray | None:
    """What the tracker of these features says of its own forecast, m^2 [P, 2, 2]; None of true states."""
    tracker = dict(source["tracker"])
    if settings.noncausal or tracker.pop("kind") != "kalman":
        return None
    interval_s = detection_dt_s * source["sensor"]["every"]
    ahead_s = (np.arange(settings.horizon_steps) + 1) * settings.dt_s
    return kalman_covariance(KalmanSettings(**tracker), interval_s, ahead_s)


@dataclass(frozen=True)
class Comparison:
    """What all scenes of a test set are forecast with.

    Attributes:
        features: folder of their shards.
        settings: of the features.
        source: configuration of the scenes.
        networks: by name.
        baselines: names of the untrained methods.
        options: `evaluation` configuration.
        out: folder for the forecasts.
    """

    features: Path
    settings: FeatureSettings
    source: Mapping[str, Any]
    networks: Mapping[str, NetworkForecaster]
    baselines: Sequence[str]
    options: Mapping[str, Any]
    out: Path


def compared_in(folder: Path, common: Comparison) -> tuple[str, dict[str, Scores]]:
    """One worker's job, on one thread, whatever their number: write the forecasts of one scene.

    Returns:
        Name of the scene, and the scores of each method there.
    """
    torch.set_num_threads(1)
    scene, settings = read_scene(folder), common.settings
    table = read_shard(common.features, scene.name, settings)
    forecasts = {name: network.predict for name, network in common.networks.items()}
    kalman = kalman_spread(common.source, scene.detection_dt_s, settings)
    social_force = common.source["social_force"]
    columns, scores = compare(
        scene, table, settings, forecasts, common.baselines, common.options, social_force, kalman
    )
    write_columns(columns, common.out / f"{scene.name}.parquet")
    return scene.name, scores


@stage
def main(cfg: DictConfig) -> None:
    """Test the networks in the folder `networks` on the sets of `fold`; write metrics and forecasts.

    Several scenes at once (see `pedpred.workers`).
    """
    kind, options = cfg.kind, plain(cfg.evaluation)
    where = {"simulated": "simulation"}.get(kind, kind)
    groups = plain(cfg.methods)
    options["imagined_goals"] = groups["baselines"]["goal_unseen"]["settings"]["imagined_goals"]
    baselines = [key for key, method in groups["baselines"].items() if where in method["where"]]
    learned = [key for key, method in groups["networks"].items() if where in method["where"]]
    out = Path(cfg.get("out", f"data/forecasts/{kind}/{cfg.fold}"))
    metrics: dict = {}
    autoencoder = Path("models/autoencoder")
    networks = {name: forecaster(Path(cfg.networks, name), autoencoder) for name in learned}
    for key in cfg.folds[kind][cfg.fold].test:
        features, source = Path("data/features", kind, key), plain(cfg[SETS[kind]][key])
        source["tracker"] = row(cfg, "trackers", source["tracker"])
        source["sensor"] = row(cfg, "sensors", source["sensor"])
        source["social_force"] = row(cfg, "social_forces", source["social_force"])
        settings, _ = read_manifest(features)
        common = Comparison(features, settings, source, networks, baselines, options, out)
        folders = scene_folders(Path("data/scenes", kind, key))
        scores = dict(in_parallel(compared_in, [(f, common) for f in folders], f"evaluate {key}", "scene"))
        metrics |= figures(key, scores, options["bootstrap"], options["seed"], settings.noncausal)
    write_json(Path(cfg.get("metrics", f"data/metrics/{kind}/{cfg.fold}.json")), metrics)


if __name__ == "__main__":
    main()
