"""embed@kind: the frozen encoder's output for all crops to train on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from omegaconf import DictConfig

from pedpred.config import stage
from pedpred.errors import ConfigError
from pedpred.models.features import RowFormat
from pedpred.models.lstm.autoencoder import GridEncoder
from pedpred.models.lstm.encoding import encode_once, load_encoder
from pedpred.rows.files import read_crops, read_manifest, write_embeddings
from pedpred.workers import in_parallel


def embed_into(out: Path, features: Path, shard: str, row_format: RowFormat, encoder: GridEncoder) -> None:
    """One worker's job, on one thread, whatever their number: the embeddings of one scene, in half precision.

    Half precision is for training, which reads them many times; forecasts use exact embeddings.
    """
    torch.set_num_threads(1)
    crops = read_crops(features, shard, row_format)
    write_embeddings((encode_once(encoder, block).astype(np.float16) for block in crops), out, shard)


@stage("rows")
def main(cfg: DictConfig) -> None:
    """Read models/autoencoder and all rows below the folder `rows`, write their embeddings below `out`."""
    rows, out = Path(cfg.rows), Path(cfg.out)
    folders = sorted(path.parent for path in rows.rglob("manifest.json"))
    if not folders:
        raise ConfigError("rows", cfg.rows, "name a folder that stages.rows has written")
    encoder = load_encoder(Path("models/autoencoder"))
    tasks = []
    for features in folders:
        row_format, shards = read_manifest(features)
        folder = out / features.relative_to(rows)
        tasks += [(folder, features, shard, row_format, encoder) for shard in shards]
    in_parallel(embed_into, tasks, f"embeddings of {rows}", "scene")


if __name__ == "__main__":
    main()
