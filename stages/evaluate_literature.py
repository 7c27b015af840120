"""evaluate_literature@fold: a network and the simple methods in the windows of ETH and UCY."""

from functools import partial
from pathlib import Path

import torch
from omegaconf import DictConfig

from pedpred.baselines.present_motion import PRESENT_MOTION
from pedpred.config import one_of, stage
from pedpred.evaluation.scores import write_scores
from pedpred.literature.measures import mean_scores, measure
from pedpred.literature.settings import ComparisonSettings
from pedpred.models.forecaster import forecaster
from pedpred.workers import in_parallel
from stages.literature_windows import comparison_of, windows_of
from stages.trials import metric_settings


def evaluate_recording(
    cfg: DictConfig, comparison: ComparisonSettings, scene: str, name: str, out: Path
) -> None:
    """Measure all methods in one recording; networks are the mean of their seeds. A job of one worker."""
    torch.set_num_threads(1)
    settings, windows = metric_settings(cfg), windows_of(cfg, comparison, name)
    if windows is None:
        return
    measured = partial(measure, windows, samples=comparison.samples, settings=settings)
    scores = {key: measured(forecaster=method()) for key, method in PRESENT_MOTION.items()}
    folders = [Path("models/literature", cfg.fold, str(seed)) for seed in comparison.seeds]
    choices = {"together": settings.together, "learning": False}  # nothing earlier than a window is known
    seeds = [measured(forecaster=forecaster(f, Path("models/autoencoder"), **choices)) for f in folders]
    scores[comparison.network] = mean_scores(seeds)
    scores |= {f"{comparison.network}_{f.name}": result for f, result in zip(folders, seeds, strict=True)}
    for method, result in scores.items():
        write_scores(result, out / scene / method / f"{name}.parquet")


@stage
def main(cfg: DictConfig) -> None:
    """Write data/literature/<fold>/<scene>/<method>/<recording>.parquet; nothing without recordings."""
    comparison = comparison_of(cfg)
    fold, out = one_of("fold", cfg.fold, comparison.folds), Path(cfg.get("out", "data/literature"), cfg.fold)
    out.mkdir(parents=True, exist_ok=True)
    pairs = [(scene, name) for scene in fold.test for name in comparison.scenes[scene]]
    tasks = [(cfg, comparison, *pair, out) for pair in pairs]
    in_parallel(evaluate_recording, tasks, f"literature, {cfg.fold}", "recording")


if __name__ == "__main__":
    main()
