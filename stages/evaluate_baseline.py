"""evaluate_baseline@method: a simple method in every window of all test sets."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.baselines.registry import baseline
from pedpred.config import configured, plain, stage, stage_key
from pedpred.forecasting import MethodRow
from pedpred.settings import load
from stages.trials import evaluate, tested_sets


@stage
def main(cfg: DictConfig) -> None:
    """Write data/forecasts/baselines/<name> and data/scores/baselines/<name>, a folder per test set."""
    name = stage_key(cfg)
    with configured(f"methods.baselines.{name}"):
        method: MethodRow = load(MethodRow, plain(cfg.methods.baselines[name]))
        forecaster = baseline(name, method.settings)
    models, folds = Path("baselines", name), [fold for study in cfg.folds.values() for fold in study.values()]
    evaluate(cfg, tested_sets(folds, method.where), models, forecaster, rollouts=True)


if __name__ == "__main__":
    main()
