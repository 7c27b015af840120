"""evaluate_sim, evaluate_place: every forecaster in every window of the test scenes."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from omegaconf import DictConfig
from tqdm import tqdm

from pedpred.baselines.kinematic import kalman_covariance
from pedpred.config import plain, stage, stage_key
from pedpred.evaluation.compare import compare
from pedpred.evaluation.summary import figures
from pedpred.features import FeatureSettings
from pedpred.files import write_json
from pedpred.models.encoding import encode, load_encoder
from pedpred.models.forecasting import forecast_motion, load_motion_lstm
from pedpred.storage.columns import write_columns
from pedpred.storage.scenes import read_scene, scene_folders
from pedpred.storage.shards import read_manifest, read_shard
from pedpred.tracking import KalmanSettings


def kalman_spread(
    source: Mapping[str, Any], detection_dt_s: float, settings: FeatureSettings
) -> np.ndarray | None:
    """What the tracker of these features says of its own forecast, m^2 [P, 2, 2]; None of true states."""
    tracker = dict(source["tracker"])
    if settings.leaks or tracker.pop("kind") != "kalman":
        return None
    interval_s = detection_dt_s * source["sensor"]["every"]
    ahead_s = (np.arange(settings.horizon_steps) + 1) * settings.dt_s
    return kalman_covariance(KalmanSettings(**tracker), interval_s, ahead_s)


@stage
def main(cfg: DictConfig) -> None:
    """Write metrics and data/forecasts/<name>; `name` is sim or real, `place` one of its test sets."""
    name, options = stage_key(cfg), cfg.evaluation
    torch.set_num_threads(options.threads)
    out = Path(cfg.get("out", f"data/forecasts/{name}"))
    metrics: dict = {}
    encoder = load_encoder(Path("models/autoencoder"))
    place = cfg.get("place")
    for test, phase in ({place: options[name][place]} if place else options[name]).items():
        networks = {model: load_motion_lstm(Path("models") / phase / model) for model in options.models}
        baselines, social_force = list(options.baselines[name]), plain(cfg.scenes[test].social_force)
        settings, _ = read_manifest(Path("data/features") / test)
        scores = {}
        for folder in tqdm(scene_folders(Path("data/scenes") / test), desc=f"evaluate {test}"):
            scene = read_scene(folder)
            table = read_shard(Path("data/features") / test, scene.name, settings)
            codes = encode(encoder, table.occupancy, settings.grid_cells)
            forecasts = {m: forecast_motion(n, table, codes, settings) for m, n in networks.items()}
            kalman = kalman_spread(plain(cfg.scenes[test]), scene.detection_dt_s, settings)
            columns, scores[scene.name] = compare(
                scene, table, settings, forecasts, baselines, options, social_force, kalman
            )
            write_columns(columns, out / f"{scene.name}.parquet")
        metrics |= figures(test, scores, options.bootstrap, options.seed, settings.leaks)
    write_json(Path(cfg.get("metrics", f"reports/metrics/{name}.json")), metrics)


if __name__ == "__main__":
    main()
