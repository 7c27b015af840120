"""evaluate_<study>: every forecaster in every window of the test scenes of a fold."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from omegaconf import DictConfig

from pedpred.baselines.registry import baselines
from pedpred.config import SETS, configured, plain, row, stage
from pedpred.evaluation import EvaluationSettings, Scores
from pedpred.evaluation.compare import compare
from pedpred.evaluation.summary import figures
from pedpred.features import FeatureSettings
from pedpred.files import write_json
from pedpred.forecasting import Forecaster, ForecastRequest, Methods
from pedpred.networks import forecaster
from pedpred.simulation.settings import SocialForceSettings, social_force_settings
from pedpred.storage.scenes import read_scene, scene_folders
from pedpred.storage.shards import read_manifest, read_shard
from pedpred.storage.windows import write_windows
from pedpred.tracking import KalmanSettings
from pedpred.workers import in_parallel


@dataclass(frozen=True)
class Comparison:
    """What all scenes of a test set are forecast with.

    Attributes:
        features: folder of their shards.
        sizes: of the features.
        tracker: noise of the filter; None where states are true.
        every: detections used, one of so many.
        social_force: the model of walking there.
        forecasters: by method.
        settings: of the metrics.
        out: folder for the forecasts.
    """

    features: Path
    sizes: FeatureSettings
    tracker: KalmanSettings | None
    every: int
    social_force: SocialForceSettings
    forecasters: Mapping[str, Forecaster]
    settings: EvaluationSettings
    out: Path


def compare_in(folder: Path, given: Comparison) -> tuple[str, dict[str, Scores]]:
    """Write the forecasts of one scene, on one thread in every worker.

    Returns:
        Name of the scene, and the scores of each method there; none if its recording is not available.
    """
    torch.set_num_threads(1)
    scene = read_scene(folder)
    if scene.unavailable is not None:
        return scene.name, {}
    table = read_shard(given.features, scene.name, given.sizes)
    interval_s = scene.detection_dt_s * given.every
    rows = np.flatnonzero(table.window)
    request = ForecastRequest(scene, table, given.sizes, rows, given.tracker, interval_s, given.social_force)
    windows, scores = compare(request, given.forecasters, given.settings)
    write_windows(windows, given.out / f"{scene.name}.parquet")
    return scene.name, scores


def tracker_of(plain_tracker: dict[str, Any], noncausal: bool) -> KalmanSettings | None:
    """The filter that tracked states come from; None where they are true or know the future."""
    kind = plain_tracker.pop("kind")
    return KalmanSettings(**plain_tracker) if kind == "kalman" and not noncausal else None


def forecasters_of(cfg: DictConfig, methods: Methods, kind: str) -> dict[str, Forecaster]:
    """The methods that are applied to sets of a kind; those with weights come from the folder `networks`."""
    applied = methods.applied_to(kind)
    learned = [method.key for method in applied if method.key in cfg.methods.networks]
    simple = baselines(method for method in applied if method.key not in learned)
    return simple | {m: forecaster(Path(cfg.networks, m), Path("models/autoencoder")) for m in learned}


@stage
def main(cfg: DictConfig) -> None:
    """Test the networks in the folder `networks` on the sets of `fold` of `study`; write metrics, forecasts.

    Several scenes at once (see `pedpred.workers`).
    """
    methods, fold = Methods.parse(plain(cfg.methods)), f"{cfg.study}/{cfg.fold}"
    out = Path(cfg.get("out", f"data/forecasts/{fold}"))
    out.mkdir(parents=True, exist_ok=True)  # also if no place is available
    metrics: dict = {}
    with configured("evaluation"):
        settings = EvaluationSettings.parse(plain(cfg.evaluation))
    for tested in cfg.folds[cfg.study][cfg.fold].test:
        kind, key = tested.split("/")
        features, source = Path("data/features", tested), cfg[SETS[kind]][key]
        sizes, _ = read_manifest(features)
        given = Comparison(
            features,
            sizes,
            tracker_of(row(cfg, "trackers", source.tracker), sizes.noncausal),
            row(cfg, "sensors", source.sensor)["every"],
            social_force_settings(row(cfg, "social_forces", source.social_force)),
            forecasters_of(cfg, methods, kind),
            settings,
            out,
        )
        folders = scene_folders(Path("data/scenes", tested))
        found = in_parallel(compare_in, [(f, given) for f in folders], f"evaluate {key}", "scene")
        scores = {scene: own for scene, own in found if own}
        metrics |= figures(key, scores, methods.reference.key, settings, sizes.noncausal) if scores else {}
    write_json(Path(cfg.get("metrics", f"data/metrics/{fold}.json")), metrics)


if __name__ == "__main__":
    main()
