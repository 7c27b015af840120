"""features@scene: tracked states, grids and targets of every scene of a set, as Parquet shards."""

from __future__ import annotations

import os
from pathlib import Path

from joblib import Parallel, delayed
from omegaconf import DictConfig
from tqdm import tqdm

from pedpred.config import plain, stage, stage_key
from pedpred.features import FeatureSettings, extract_blocks
from pedpred.storage.scenes import read_scene, scene_folders
from pedpred.storage.shards import write_manifest, write_shard
from pedpred.tracking import KalmanSettings, follow


def features_into(
    out: Path, folder: Path, settings: FeatureSettings, tracker: dict, standstill_mps: float
) -> None:
    """One worker's job: the shard of one scene."""
    scene = read_scene(folder)
    noise = {key: value for key, value in tracker.items() if key != "kind"}
    kalman = KalmanSettings(**noise) if noise else None
    tracks = follow(scene.recording, tracker["kind"], kalman, standstill_mps)
    write_shard(extract_blocks(scene, tracks, settings), out, scene.name)


@stage
def main(cfg: DictConfig) -> None:
    """Read data/scenes/<key>, write data/features/<key>; $PEDPRED_JOBS workers (all cores by default)."""
    key = stage_key(cfg)
    out = Path(cfg.get("out", f"data/features/{key}"))
    groups = plain(cfg)
    standstill_mps = groups["features"].pop("standstill_mps")
    source = groups["scenes"][key]
    settings = FeatureSettings(**groups["protocol"], **groups["features"], clocks=source["clocks"])
    folders = scene_folders(Path("data/scenes") / key)
    jobs = int(os.environ.get("PEDPRED_JOBS", os.cpu_count() or 1))
    workers = Parallel(n_jobs=jobs, return_as="generator_unordered")  # it gives each one its share of threads
    done = workers(
        delayed(features_into)(out, folder, settings, source["tracker"], standstill_mps) for folder in folders
    )
    for _ in tqdm(done, total=len(folders), desc=f"features of {key}", unit="scene"):
        pass
    write_manifest(out, settings, {folder.name: folder for folder in folders})


if __name__ == "__main__":
    main()
