"""pretrain_autoencoder: learn to compress the occupancy crops of the training layouts."""

from pathlib import Path

import numpy as np
import pandas as pd
import torch
from omegaconf import DictConfig

from pedpred.config import configured, plain, stage
from pedpred.datasets.crops import crops_of
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.training.fit import manifests_sha256, write_curve
from pedpred.training.loop import scratch_folder, train
from pedpred.training.pretraining import AutoencoderLearner, AutoencoderSettings


@stage
def main(cfg: DictConfig) -> None:
    """Read data/features/simulated/main, write models/autoencoder and its curve."""
    options = plain(cfg.autoencoder)
    torch.set_num_threads(options.pop("threads"))
    share, crops = options.pop("validation_share"), options.pop("validation_crops")
    with configured("autoencoder"):
        settings = AutoencoderSettings(**options)
    features = Path("data/features/simulated/main")
    training, validation, cells = crops_of(features, share, crops, np.random.default_rng(settings.seed))
    about = {"kind": "autoencoder", "settings": options, "cells": cells}
    origin = {"share": share, "crops": crops, "features_sha256": manifests_sha256([features])}
    with scratch_folder({**about, **origin}) as scratch:
        learner = AutoencoderLearner(training, validation, cells, settings)
        curve = train(learner, scratch, "auto-encoder")
    out = Path(cfg.get("out", "models/autoencoder"))
    write_checkpoint(out, learner.network.state_dict(), about)
    write_curve(pd.DataFrame(curve), Path(cfg.get("curve", "reports/curves/sim/autoencoder.tsv")))


if __name__ == "__main__":
    main()
