"""encode@scene: the frozen convolutions' output for every occupancy crop, once and for all."""

from pathlib import Path

import torch
from omegaconf import DictConfig
from tqdm import tqdm

from pedpred.config import stage, stage_key
from pedpred.models import GridAutoencoder
from pedpred.storage.checkpoints import load_weights, read_checkpoint
from pedpred.storage.shards import read_crops, read_manifest, write_codes
from pedpred.training.autoencoder import encode


@stage
def main(cfg: DictConfig) -> None:
    """Read data/features/<name> and models/autoencoder, write data/codes/<name>."""
    name = stage_key(cfg)
    torch.set_num_threads(cfg.autoencoder.threads)
    weights, about = read_checkpoint(Path("models/autoencoder"))
    network = GridAutoencoder(about["settings"]["latent"])
    load_weights(network, weights, Path("models/autoencoder"))
    features, out = Path("data/features") / name, Path(cfg.get("out", f"data/codes/{name}"))
    settings, shards = read_manifest(features)
    for shard in tqdm(shards, desc=f"codes of {name}"):
        crops = read_crops(features, shard, settings)
        write_codes((encode(network, block, settings.grid_cells) for block in crops), out, shard)


if __name__ == "__main__":
    main()
