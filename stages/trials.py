"""What the stages that evaluate share: where a method is tested, and the forecasts there."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import SETS, configured, one_of, plain, row
from pedpred.evaluation import MetricSettings
from pedpred.evaluation.compare import Trial, evaluate_scene
from pedpred.forecasting import Forecaster
from pedpred.models.lstm.features import LstmFeatures
from pedpred.settings import load
from pedpred.simulation.settings import social_force_settings
from pedpred.storage.scenes import scene_folders
from pedpred.workers import in_parallel
from stages.features import perception_of


def tested_sets(folds: Iterable[Mapping[str, Any]], kinds: Iterable[str]) -> list[str]:
    """Sets that some folds test, kind/name, of some kinds; each once."""
    named = dict.fromkeys(at for fold in folds for at in fold["test"])
    return [at for at in named if at.partition("/")[0] in kinds]


def metric_settings(cfg: DictConfig) -> MetricSettings:
    """Read the choices of forecasters and the thresholds of metrics."""
    with configured("evaluation"):
        settings: MetricSettings = load(MetricSettings, plain(cfg.evaluation))
    return settings


def folders_for(cfg: DictConfig, models: Path) -> list[Path]:
    """Make the folders of a method's forecasts and scores; `out` is another root than here."""
    folders = [Path(cfg.get("out", "."), "data", results, models) for results in ("forecasts", "scores")]
    for folder in folders:
        folder.mkdir(parents=True, exist_ok=True)  # also if no place is available
    return folders


def evaluate(
    cfg: DictConfig,
    sets: Iterable[str],
    models: Path,
    forecaster: Forecaster,
    rollouts: bool = False,
    memory: bool = False,
    shown: LstmFeatures | None = None,
    prepare: Callable[[], object] | None = None,
) -> None:
    """Forecast and measure all scenes of some test sets, several at once (see `pedpred.workers`).

    Args:
        cfg: the configuration.
        sets: kind/name of each.
        models: folder of the method below data/forecasts and data/scores; its last part is the method's key.
        forecaster: of the method.
        rollouts: the forecaster moves people by the place's model of walking.
        memory: the forecaster reads the steps of a clock.
        shown: grids that the forecaster reads, for pictures; None: it reads none.
        prepare: called first in each worker.
    """
    settings, tasks = metric_settings(cfg), []
    outs = folders_for(cfg, models)
    for at in sets:
        kind, key = at.split("/")
        source = cfg[one_of("kind", kind, SETS)][key]
        how, protocol = perception_of(cfg, source)
        walking = social_force_settings(row(cfg, "social_forces", source.social_force)) if rollouts else None
        trial = Trial(models.name, forecaster, how, protocol, walking, settings, memory, shown)
        tasks += [(f, trial, *(out / at for out in outs)) for f in scene_folders(Path("data/scenes", at))]
    in_parallel(partial(_evaluate_scene, prepare), tasks, f"evaluate {models.name}", "scene")


def _evaluate_scene(prepare: Callable[[], object] | None, *task: Any) -> None:
    if prepare is not None:
        prepare()
    evaluate_scene(*task)
