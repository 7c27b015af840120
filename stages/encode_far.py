"""encode_far: the frozen encoder's output for every crop of the steps of the literature's time step."""

from pathlib import Path

import numpy as np
import torch
from omegaconf import DictConfig

from pedpred.config import stage
from pedpred.models.features import RowFormat
from pedpred.models.lstm.autoencoder import GridEncoder
from pedpred.models.lstm.encoding import encode, load_encoder
from pedpred.storage.shards import read_crops, read_manifest, write_embeddings
from pedpred.workers import in_parallel

STEPS = Path("data/far/steps")


def embed_into(out: Path, features: Path, shard: str, made_with: RowFormat, encoder: GridEncoder) -> None:
    """Write the embeddings of one shard, equal crops encoded once. A job of one worker, on one thread."""
    torch.set_num_threads(1)

    def embedded(crops: np.ndarray) -> np.ndarray:
        """Of a block, which has the free crop alone where there is no map."""
        different, index = np.unique(crops, axis=0, return_inverse=True)
        return encode(encoder, different).astype(np.float16)[index.ravel()]

    write_embeddings((embedded(block) for block in read_crops(features, shard, made_with)), out, shard)


@stage
def main(cfg: DictConfig) -> None:
    """Read the folders of data/far/steps and models/autoencoder, write data/far/embeddings/<set>."""
    encoder, out = load_encoder(Path("models/autoencoder")), Path(cfg.get("out", "data/far/embeddings"))
    tasks = []
    for features in sorted(path.parent for path in STEPS.rglob("manifest.json")):
        made_with, shards = read_manifest(features)
        folder = out / features.relative_to(STEPS)
        tasks += [(folder, features, shard, made_with, encoder) for shard in shards]
    in_parallel(embed_into, tasks, "embeddings of steps", "scene")


if __name__ == "__main__":
    main()
