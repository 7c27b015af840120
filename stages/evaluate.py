"""evaluate@method: a method in every window of the test sets, with weights that have not seen them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import torch
from omegaconf import DictConfig

from pedpred.baselines.registry import baseline
from pedpred.config import SETS, configured, one_of, plain, row, stage, stage_key
from pedpred.evaluation import MetricSettings
from pedpred.evaluation.compare import Trial, evaluate_scene
from pedpred.forecasting import MethodRow
from pedpred.models.forecaster import forecaster
from pedpred.models.lstm.features import LstmFeatures
from pedpred.settings import load
from pedpred.simulation.settings import social_force_settings
from pedpred.storage.scenes import scene_folders
from pedpred.workers import in_parallel
from stages.perception import perception_of

RESULTS = (Path("data/forecasts"), Path("data/scores"))
AUTOENCODER = Path("models/autoencoder")
Folds = Mapping[str, Mapping[str, Any]]


def tested_sets(folds: Iterable[Mapping[str, Any]], kinds: Iterable[str]) -> list[str]:
    """Sets that some folds test, kind/name, of some kinds; each once."""
    named = dict.fromkeys(at for fold in folds for at in fold["test"])
    return [at for at in named if at.partition("/")[0] in kinds]


def metric_settings(cfg: DictConfig) -> MetricSettings:
    """Read the choices of forecasters and the thresholds of metrics."""
    with configured("evaluation"):
        settings: MetricSettings = load(MetricSettings, plain(cfg.evaluation))
    return settings


def trials_of_baseline(cfg: DictConfig, name: str) -> Iterator[tuple[str, Path, Trial]]:
    """A simple method at all test sets."""
    with configured(f"methods.baselines.{name}"):
        method: MethodRow = load(MethodRow, plain(cfg.methods.baselines[name]))
        simple = baseline(name, method.settings)
    folds = [fold for study in cfg.folds.values() for fold in study.values()]
    for at in tested_sets(folds, method.where):
        source = source_of(cfg, at)
        walking = social_force_settings(row(cfg, "social_forces", source.social_force))
        yield at, Path(name), Trial(name, simple, *perception_of(cfg, source), walking, metric_settings(cfg))


def trials_of_network(cfg: DictConfig, name: str) -> Iterator[tuple[str, Path, Trial]]:
    """A network at all test sets: with the weights of the main training, and with those of each fold."""
    where, settings = cfg.methods.networks[name].where, metric_settings(cfg)
    links = {link: getattr(settings, link) for link in ("together", "learning", "trust")}
    untrained = [fold for study in cfg.folds.values() for fold in study.values() if "train" not in fold]
    trained = {key: fold for study in cfg.folds.values() for key, fold in study.items() if "train" in fold}
    models = f"models/{cfg.methods.networks[name].settings.architecture}"
    tested = [("main", Path(f"{models}_main", name), untrained)]
    tested += [(key, Path(f"{models}_folds", name, key), [fold]) for key, fold in trained.items()]
    for key, weights, folds in tested:
        network = forecaster(weights, AUTOENCODER, **links)
        memory = bool(network.network.state_shapes)
        grids = network.features if isinstance(network.features, LstmFeatures) else None  # for pictures
        for at in tested_sets(folds, where):
            seen = perception_of(cfg, source_of(cfg, at))
            yield at, Path(name, key), Trial(name, network, *seen, None, settings, memory, grids)


def source_of(cfg: DictConfig, at: str) -> DictConfig:
    """The row of simulations or places that a set comes from."""
    kind, key = at.split("/")
    return cfg[one_of("kind", kind, SETS)][key]


@stage
def main(cfg: DictConfig) -> None:
    """Write data/forecasts/<name> and data/scores/<name>: a folder per test set, of networks per weights.

    Several scenes are measured at once; `out` is another root than here.
    """
    name, outs = stage_key(cfg), [Path(cfg.get("out", "."), top) for top in RESULTS]
    trials_of = trials_of_baseline if name in cfg.methods.get("baselines", {}) else trials_of_network
    if trials_of is trials_of_network:
        one_of("name", name, cfg.methods.get("networks", {}))
    tasks = []
    for out in outs:
        (out / name).mkdir(parents=True, exist_ok=True)  # also if no place is available
    for at, folder, trial in trials_of(cfg, name):
        scenes = scene_folders(Path("data/scenes", at))
        tasks += [(scene, trial, *(out / folder / at for out in outs)) for scene in scenes]
    in_parallel(evaluate_on_one_thread, tasks, f"evaluate {name}", "scene")


def evaluate_on_one_thread(*task: Any) -> None:
    """Measure one scene. A job of one worker."""
    torch.set_num_threads(1)
    evaluate_scene(*task)


if __name__ == "__main__":
    main()
