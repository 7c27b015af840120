"""encode@scene: the frozen convolutions' output for every occupancy crop, once and for all."""

from __future__ import annotations

from pathlib import Path

import torch
from omegaconf import DictConfig

from pedpred.config import stage, stage_key
from pedpred.features.table import FeatureSettings
from pedpred.models.autoencoder import GridAutoencoder, read_autoencoder
from pedpred.storage.shards import read_crops, read_manifest, write_codes
from pedpred.training.autoencoder import encode
from pedpred.workers import in_parallel


def codes_into(
    out: Path, features: Path, shard: str, settings: FeatureSettings, network: GridAutoencoder
) -> None:
    """One worker's job, on one thread, whatever their number: the codes of one scene."""
    torch.set_num_threads(1)
    crops = read_crops(features, shard, settings)
    write_codes((encode(network, block, settings.grid_cells) for block in crops), out, shard)


@stage
def main(cfg: DictConfig) -> None:
    """Read data/features/<name> and models/autoencoder, write data/codes/<name>, several scenes at once."""
    name = stage_key(cfg)
    network, _ = read_autoencoder(Path("models/autoencoder"))
    features, out = Path("data/features") / name, Path(cfg.get("out", f"data/codes/{name}"))
    settings, shards = read_manifest(features)
    tasks = [(out, features, shard, settings, network) for shard in shards]
    in_parallel(codes_into, tasks, f"codes of {name}", "scene")


if __name__ == "__main__":
    main()
