"""distil_encoder: train a narrow encoder on the full one's embeddings, for the distilled export."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from omegaconf import DictConfig

from pedpred.config import configured, plain, stage
from pedpred.datasets.crops import EmbeddedSplit, embedded_crops_of
from pedpred.networks.encoding import load_encoder
from pedpred.simulation.fields import parsed_together
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.training.distillation import DistillationLearner, DistillationSettings
from pedpred.training.distributed import ThreadSettings
from pedpred.training.fit import manifests_sha256, write_curve
from pedpred.training.loop import scratch_folder, train


@stage
def main(cfg: DictConfig) -> None:
    """Read features and embeddings of simulated/main and models/autoencoder, write models/distilled."""
    options = plain(cfg.distilled)
    with configured("distilled"):
        kinds = [ThreadSettings, EmbeddedSplit, DistillationSettings]
        threads, split, settings = parsed_together(kinds, options)
    torch.set_num_threads(threads.threads)
    features, rng = Path("data/features/simulated/main"), np.random.default_rng(settings.seed)
    embeddings = Path("data/embeddings/simulated/main")
    with configured("distilled"):
        training, validation = embedded_crops_of(features, embeddings, split, rng)
    teacher = load_encoder(Path("models/autoencoder"))
    about = {
        "kind": "encoder",
        "settings": asdict(settings) | {"latent": teacher.fc.out_features},
        "cells": training.cells,
    }
    origin = {**asdict(split), "features_sha256": manifests_sha256([features])}
    with configured("distilled"), scratch_folder({**about, **origin}, teacher.state_dict()) as scratch:
        learner = DistillationLearner(teacher, training, validation, settings)
        curve = train(learner, scratch, "narrow encoder")
    weights = {f"encoder.{name}": value for name, value in learner.network.state_dict().items()}
    out = Path(cfg.get("out", "models/distilled"))
    write_checkpoint(out, weights, about)
    write_curve(pd.DataFrame(curve), out / "curve.tsv")


if __name__ == "__main__":
    main()
