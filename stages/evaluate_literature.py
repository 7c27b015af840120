"""evaluate_literature@fold: networks and simple methods in the windows of ETH and UCY."""

from functools import partial
from pathlib import Path

import torch
from omegaconf import DictConfig

from pedpred.baselines.present_motion import PRESENT_MOTION
from pedpred.config import one_of, stage
from pedpred.evaluation.scores import write_scores
from pedpred.literature.measures import mean_scores, measure
from pedpred.models.forecaster import forecaster
from pedpred.workers import in_parallel
from stages.literature import networks_of
from stages.literature_windows import windows_of
from stages.trials import metric_settings


def evaluate_recording(cfg: DictConfig, scene: str, name: str, out: Path) -> None:
    """Measure all methods in one recording; networks are the mean of their seeds. A job of one worker."""
    torch.set_num_threads(1)
    settings, windows = metric_settings(cfg), windows_of(cfg, name)
    if windows is None:
        return
    measured = partial(measure, windows, samples=cfg.literature.samples, settings=settings)
    scores = {key: measured(forecaster=method()) for key, method in PRESENT_MOTION.items()}
    choices = {"together": settings.together, "learning": False, "trust": False}  # nothing earlier is known
    for network in networks_of(cfg):
        folders = {s: Path("models/literature", cfg.fold, network, str(s)) for s in cfg.literature.seeds}
        trained = {s: forecaster(f, Path("models/autoencoder"), **choices) for s, f in folders.items()}
        seeds = {f"{network}_{s}": measured(forecaster=method) for s, method in trained.items()}
        scores |= {network: mean_scores(list(seeds.values()))} | seeds
    for method, result in scores.items():
        write_scores(result, out / scene / method / f"{name}.parquet")


@stage
def main(cfg: DictConfig) -> None:
    """Write data/literature/<fold>/<scene>/<method>/<recording>.parquet; nothing without recordings."""
    fold = one_of("fold", cfg.fold, cfg.literature.folds)
    out = Path(cfg.get("out", "data/literature"), cfg.fold)
    out.mkdir(parents=True, exist_ok=True)
    tasks = [(cfg, scene, name, out) for scene in fold.test for name in cfg.literature.scenes[scene]]
    in_parallel(evaluate_recording, tasks, f"literature, {cfg.fold}", "recording")


if __name__ == "__main__":
    main()
