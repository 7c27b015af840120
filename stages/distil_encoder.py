"""distil_encoder: a narrow encoder learns the full one's codes, for the distilled export."""

from pathlib import Path

import numpy as np
import pandas as pd
import torch
from omegaconf import DictConfig

from pedpred.config import plain, stage
from pedpred.datasets.crops import embedded_crops_of
from pedpred.networks.encoding import load_encoder
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.training.distillation import DistillationSettings, distil
from pedpred.training.fit import write_curve


@stage
def main(cfg: DictConfig) -> None:
    """Read features and embeddings of simulated/main and models/autoencoder, write models/distilled."""
    options = plain(cfg.distilled)
    torch.set_num_threads(options.pop("threads"))
    share, every = options.pop("validation_share"), options.pop("every")
    settings = DistillationSettings(**options | {"widths": tuple(options["widths"])})
    training, validation = embedded_crops_of(
        Path("data/features/simulated/main"),
        Path("data/embeddings/simulated/main"),
        share,
        every,
        np.random.default_rng(settings.seed),
    )
    encoder, curve = distil(load_encoder(Path("models/autoencoder")), training, validation, settings)
    about = {"kind": "encoder", "settings": options | {"latent": encoder.fc.out_features}}
    weights = {f"encoder.{name}": value for name, value in encoder.state_dict().items()}
    out = Path(cfg.get("out", "models/distilled"))
    write_checkpoint(out, weights, about)
    write_curve(pd.DataFrame(curve), out / "curve.tsv")


if __name__ == "__main__":
    main()
