"""evaluate_main, evaluate_fold and their like: a network in every window of the test sets of a fold."""

from functools import partial
from pathlib import Path

import torch
from omegaconf import DictConfig

from pedpred.config import one_of, stage, stage_key
from pedpred.models.forecaster import forecaster
from pedpred.models.lstm.features import LstmFeatures
from stages.trials import evaluate, metric_settings, tested_sets


@stage
def main(cfg: DictConfig) -> None:
    """Test models/<networks>/<name>; write <networks>/<name> below data/forecasts and data/scores.

    `networks` is `main`, for the sets of all folds that train nothing, or `folds/<fold>`.
    """
    name, groups = stage_key(cfg), [rows for group, rows in cfg.methods.items() if group != "baselines"]
    where = one_of("name", name, {key: row for rows in groups for key, row in rows.items()}).where
    untrained = [each for study in cfg.folds.values() for each in study.values() if "train" not in each]
    real = cfg.folds.real if "real" in cfg.folds else {}
    tested = {"main": untrained} | {f"folds/{key}": [fold] for key, fold in real.items()}
    folds = one_of("networks", cfg.networks, tested)
    chain, models = metric_settings(cfg), Path(cfg.networks, name)
    choices = {link: getattr(chain, link) for link in ("together", "learning", "trust")}
    network = forecaster(Path("models", models), Path("models/autoencoder"), **choices)
    memory = bool(network.network.state_shapes)
    grids = network.features if isinstance(network.features, LstmFeatures) else None
    one_thread = partial(torch.set_num_threads, 1)
    evaluate(cfg, tested_sets(folds, where), models, network, memory=memory, shown=grids, prepare=one_thread)


if __name__ == "__main__":
    main()
