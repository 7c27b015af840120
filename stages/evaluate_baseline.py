"""evaluate_baseline@method: a simple method in every window of all test sets."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.baselines.registry import baseline
from pedpred.config import configured, plain, stage, stage_key
from pedpred.evaluation.literature import (
    LiteratureSettings,
    ask_about_stretches,
    find_stretches,
    score_stretches,
)
from pedpred.evaluation.scores import write_scores
from pedpred.fields import parsed
from pedpred.forecasting import Forecaster, MethodRow
from pedpred.storage.scenes import read_scene
from stages.features import kalman_of
from stages.trials import evaluate, folders_for, metric_settings, tested_sets

NATIVE = "literature"
"""Kind of test sets: the native annotations of a real place."""


def evaluate_native(cfg: DictConfig, at: str, models: Path, forecaster: Forecaster) -> None:
    """Measure a method on the native annotations of a place, under the protocol of the literature."""
    with configured("literature"):
        protocol: LiteratureSettings = parsed(LiteratureSettings, plain(cfg.literature))
    place, scores = at.split("/")[1], folders_for(cfg, models)[1]
    scene = read_scene(Path("data/scenes/real", place))
    if scene.unavailable is None:
        steps = protocol.observed_steps, protocol.predicted_steps, protocol.step_s
        windows = find_stretches(scene.trajectories, *steps)
        request = ask_about_stretches(scene, windows, kalman_of(cfg, cfg.places[place].tracker))
        measured = score_stretches(request, windows, forecaster, metric_settings(cfg))
        write_scores(measured, scores / at / f"{scene.name}.parquet")


@stage
def main(cfg: DictConfig) -> None:
    """Write data/forecasts/baselines/<name> and data/scores/baselines/<name>, a folder per test set."""
    name = stage_key(cfg)
    with configured(f"methods.baselines.{name}"):
        method: MethodRow = parsed(MethodRow, plain(cfg.methods.baselines[name]))
        forecaster = baseline(name, method.settings)
    models, folds = Path("baselines", name), [fold for study in cfg.folds.values() for fold in study.values()]
    evaluate(cfg, tested_sets(folds, set(method.where) - {NATIVE}), models, forecaster)
    for at in tested_sets(folds, set(method.where) & {NATIVE}):
        evaluate_native(cfg, at, models, forecaster)


if __name__ == "__main__":
    main()
