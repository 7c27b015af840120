"""features@scene: tracked states, grids and targets of every scene of a set, as Parquet shards."""

from pathlib import Path

from omegaconf import DictConfig
from tqdm import tqdm

from pedpred.config import stage, stage_key
from pedpred.features import FeatureSettings, extract
from pedpred.storage.scenes import read_scene, scene_folders
from pedpred.storage.shards import write_manifest, write_shard
from pedpred.tracking import KalmanSettings, follow


@stage
def main(cfg: DictConfig) -> None:
    """Read data/scenes/<key>, write data/features/<key>."""
    key = stage_key(cfg)
    out = Path(cfg.get("out", f"data/features/{key}"))
    source = cfg.scenes[key]
    sizes = {k: v for k, v in cfg.features.items() if k != "standstill_mps"}
    settings = FeatureSettings(**cfg.protocol, **sizes, clocks=source.clocks)
    filter_values = {k: v for k, v in source.tracker.items() if k != "kind"}
    kalman = KalmanSettings(**filter_values) if filter_values else None
    folders = scene_folders(Path("data/scenes") / key)
    for folder in tqdm(folders, desc=f"features of {key}"):
        scene = read_scene(folder)
        tracks = follow(scene.recording, source.tracker.kind, kalman, cfg.features.standstill_mps)
        write_shard(extract(scene, tracks, settings), out, scene.name)
    write_manifest(out, settings, {folder.name: folder / "tracks.parquet" for folder in folders})


if __name__ == "__main__":
    main()
