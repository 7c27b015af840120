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
from pedpred.evaluation.trial import Trial, evaluate_scene
from pedpred.forecasting import MethodRow
from pedpred.models.forecaster import ForecasterChoices, forecaster
from pedpred.models.lstm.features import LstmFeatures
from pedpred.settings import load, load_together
from pedpred.simulation.settings import social_force_settings
from pedpred.storage.scenes import scene_folders
from pedpred.workers import in_parallel
from stages.perception import perception_of

RESULTS = (Path("data/forecasts"), Path("data/scores"))
AUTOENCODER = Path("models/autoencoder")
WEIGHTS = ("baselines", "main", "folds")
"""Of a simple method, which has none; of the main trainings; of the folds."""


def tested_sets(folds: Iterable[Mapping[str, Any]], kinds: Iterable[str]) -> list[str]:
    """Sets that some folds test, kind/name, of some kinds; each once."""
    named = dict.fromkeys(at for fold in folds for at in fold["test"])
    return [at for at in named if at.partition("/")[0] in kinds]


def evaluation_of(cfg: DictConfig) -> tuple[MetricSettings, ForecasterChoices]:
    """Read the thresholds of metrics, and the choices of forecasters."""
    with configured("evaluation"):
        settings, choices = load_together([MetricSettings, ForecasterChoices], plain(cfg.evaluation))
    return settings, choices


def trials_of_baseline(cfg: DictConfig, name: str) -> Iterator[tuple[str, Path, Trial]]:
    """A simple method at all test sets."""
    with configured(f"methods.baselines.{name}"):
        method: MethodRow = load(MethodRow, plain(cfg.methods.baselines[name]))
        simple = baseline(name, method.settings)
    folds = [fold for study in cfg.folds.values() for fold in study.values()]
    for at in tested_sets(folds, method.where):
        source = source_of(cfg, at)
        walking = social_force_settings(row(cfg, "social_forces", source.social_force))
        settings, _ = evaluation_of(cfg)
        seen = perception_of(cfg, source)
        yield at, Path(name), Trial(name, simple, *seen, walking, settings, fits=True)


def trials_of_network(cfg: DictConfig, name: str, weights: str) -> Iterator[tuple[str, Path, Trial]]:
    """A network at all test sets: with the weights of each fold, or with those of the main training."""
    where, (settings, choices) = cfg.methods.networks[name].where, evaluation_of(cfg)
    trained = Path("models", f"{cfg.methods.networks[name].settings.architecture}_{weights}", name)
    folds = [(key, fold) for study in cfg.folds.values() for key, fold in study.items()]
    tested = [(key, [fold]) for key, fold in folds if "train" in fold]
    if weights == "main":
        tested = [("", [fold for _, fold in folds if "train" not in fold])]
    for key, of_weights in tested:
        network = forecaster(trained / key, AUTOENCODER, **vars(choices))
        memory = bool(network.network.state_shapes)
        grids = network.features if isinstance(network.features, LstmFeatures) else None  # for pictures
        for at in tested_sets(of_weights, where):
            seen = perception_of(cfg, source_of(cfg, at))
            yield at, Path(name, key), Trial(name, network, *seen, None, settings, memory, shown=grids)


def source_of(cfg: DictConfig, at: str) -> DictConfig:
    """The row of simulations or places that a set comes from."""
    kind, key = at.split("/")
    return cfg[one_of("kind", kind, SETS)][key]


@stage("name", "weights")
def main(cfg: DictConfig) -> None:
    """Write data/forecasts/<weights>/<name> and data/scores/<weights>/<name>: a folder per test set.

    `weights` are main; folds, a folder for each; or baselines, which have none. Several scenes are measured
    at once; `out` is another root than here.
    """
    name, weights = stage_key(cfg), cfg.weights
    one_of("weights", weights, dict.fromkeys(WEIGHTS))
    if weights == "baselines":
        one_of("name", name, cfg.methods.get("baselines", {}))
        trials = trials_of_baseline(cfg, name)
    else:
        one_of("name", name, cfg.methods.get("networks", {}))
        trials = trials_of_network(cfg, name, weights)
    outs, tasks = [Path(cfg.get("out", "."), top, weights) for top in RESULTS], []
    for out in outs:
        (out / name).mkdir(parents=True, exist_ok=True)  # also if no place is available
    for at, folder, trial in trials:
        scenes = scene_folders(Path("data/scenes", at))
        tasks += [(scene, trial, *(out / folder / at for out in outs)) for scene in scenes]
    in_parallel(evaluate_on_one_thread, tasks, f"evaluate {name}, {weights}", "scene")


def evaluate_on_one_thread(*task: Any) -> None:
    """Measure one scene. A job of one worker."""
    torch.set_num_threads(1)
    evaluate_scene(*task)


if __name__ == "__main__":
    main()
