"""pretrain_autoencoder: learn to compress the occupancy crops of the training layouts."""

import hashlib
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from omegaconf import DictConfig

from pedpred.config import configured, plain, stage
from pedpred.datasets.crops import CropSplit, crops_of
from pedpred.settings import load_together
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.training.distributed import ThreadSettings
from pedpred.training.fit import write_curve
from pedpred.training.loop import train
from pedpred.training.pretraining import AutoencoderLearner, AutoencoderSettings
from pedpred.training.progress import scratch_folder


@stage("curve")
def main(cfg: DictConfig) -> None:
    """Read data/rows/lstm/simulated/main, write models/autoencoder and its curve."""
    options = plain(cfg.autoencoder)
    with configured("autoencoder"):
        threads, split, settings = load_together([ThreadSettings, CropSplit, AutoencoderSettings], options)
    torch.set_num_threads(threads.threads)
    features = Path("data/rows/lstm/simulated/main")
    with configured("autoencoder"):
        training, validation, cells = crops_of(features, split, np.random.default_rng(settings.seed))
    about = {"kind": "autoencoder", "settings": asdict(settings), "cells": cells}
    manifest = (features / "manifest.json").read_bytes()
    origin = {**asdict(split), "features_sha256": hashlib.sha256(manifest).hexdigest()}
    with configured("autoencoder"), scratch_folder({**about, **origin}) as scratch:
        learner = AutoencoderLearner(training, validation, cells, settings)
        curve = train(learner, scratch, "auto-encoder")
    out = Path(cfg.get("out", "models/autoencoder"))
    write_checkpoint(out, learner.network.state_dict(), about)
    write_curve(pd.DataFrame(curve), Path(cfg.get("curve", "reports/curves/sim/autoencoder.tsv")))


if __name__ == "__main__":
    main()
