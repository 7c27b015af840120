"""evaluate_sim, evaluate_place: every forecaster in every window of the test scenes."""

from pathlib import Path

import torch
from omegaconf import DictConfig
from tqdm import tqdm

from pedpred.config import plain, stage, stage_key
from pedpred.evaluation.compare import compare
from pedpred.evaluation.summary import figures
from pedpred.files import write_json
from pedpred.models.encoding import encode, load_encoder
from pedpred.models.forecasting import forecast_velocities, load_motion_lstm
from pedpred.storage.columns import write_columns
from pedpred.storage.scenes import read_scene, scene_folders
from pedpred.storage.shards import read_manifest, read_shard


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
            velocities = {m: forecast_velocities(n, table, codes, settings) for m, n in networks.items()}
            columns, scores[scene.name] = compare(
                scene, table, settings, velocities, baselines, options, social_force
            )
            write_columns(columns, out / f"{scene.name}.parquet")
        metrics |= figures(test, scores, options.bootstrap, options.seed, settings.leaks)
    write_json(Path(cfg.get("metrics", f"reports/metrics/{name}.json")), metrics)


if __name__ == "__main__":
    main()
