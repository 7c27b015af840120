"""No test scene is used for training, by the pipeline's graph and folds; no forecast uses the future."""

import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from unittest.mock import Mock

import networkx as nx
import numpy as np
import pytest
import torch
from dvc.dependency import ParamsDependency
from omegaconf import OmegaConf

from pedpred.config import SETS
from pedpred.evaluation.windows import find_windows
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception
from pedpred.models.lstm.autoencoder import GridAutoencoder
from pedpred.tracking import KalmanSettings
from stages import evaluate, train
from stages.folds import trained_sets
from tests.configuration import read, stages
from tests.exported import NETWORK, WIDTHS, forecaster_of
from tests.worlds import walled_scene

ROOT = Path(__file__).resolve().parents[2]
PARAMS = read("params.yaml")
FOLDS = PARAMS["folds"]
PRETRAINED = ("autoencoder", "lstm_corridor", "lstm_main", "mixture_main")
"""Folders of networks that were trained in simulation only."""


def names(parts):
    """Paths in the project of dependencies or outputs; parameters are none."""
    files = [part for part in parts if not isinstance(part, ParamsDependency)]
    return [Path(part.fs_path).relative_to(ROOT).as_posix() for part in files]


def within(path, folder):
    return path == folder or path.startswith(f"{folder}/")


def makers(path):
    """The stages that write a path, something in it or a folder around it."""
    return {s for s in stages() if any(within(o, path) or within(path, o) for o in names(s.outs))}


@cache
def behind(path):
    """Every file and folder that a path of the pipeline is made from."""
    needed = makers(path).union(*(nx.descendants(stages(), stage) for stage in makers(path)))
    return {name for stage in needed for name in names(stage.deps)}


def test_no_rows_are_made_of_simulated_sets_that_are_tested():
    tested = {at for study in FOLDS.values() for fold in study.values() for at in fold["test"]}
    inputs = {row["input"].removeprefix("data/scenes/") for row in PARAMS["situations"]["simulated"].values()}
    trained = {f"simulated/{name}" for name in PARAMS["sequences"]["scenes"]}
    assert trained
    assert (trained | inputs) & tested == set()


@pytest.mark.filterwarnings("ignore:_NoneStep.value:DeprecationWarning")  # of DVC
def test_before_fine_tuning_no_network_saw_a_real_place():
    for models in PRETRAINED:
        assert not [name for name in behind(f"models/{models}") if within(name, "data/scenes/real")], models


def test_a_network_is_tested_where_it_has_never_been():
    known = {f"{kind}/{name}" for kind, rows in SETS.items() for name in PARAMS[rows]}
    for row in (row for study in FOLDS.values() for row in study.values()):
        tested = set(row["test"])
        trained = set(trained_sets(row, PARAMS["places"])) if "train" in row else set()
        assert tested
        assert trained | tested <= known | {"simulated/worlds"}
        assert tested & {*trained, "simulated/main", "simulated/corridor"} == set()
        assert {entry for entry in trained if entry.startswith("simulated/")} <= {"simulated/worlds"}


@pytest.mark.parametrize("fold", FOLDS["real"])
@pytest.mark.parametrize("training", [name for name, row in PARAMS["trainings"].items() if row.get("folds")])
def test_a_fold_trains_on_its_own_real_sets_alone(training, fold, monkeypatch):
    def record(*given, **named):
        read.update(re.findall(r"data/rows/\w+/(\w+/\w+)", repr((given, named))))
        raise InterruptedError

    read = set()
    monkeypatch.setattr(train, "load_training_rows", record)
    monkeypatch.setattr(train, "count_rows_of", lambda folder: 1)
    with pytest.raises(InterruptedError):
        train.main.__wrapped__(OmegaConf.create(PARAMS | {"name": training, "fold": fold}))
    trained = set(trained_sets(FOLDS["real"][fold], PARAMS["places"]))
    assert {key for key in read if key.startswith("real/")} == {key for key in trained if "real/" in key}
    assert read - trained <= {f"simulated/{key}" for key in PARAMS["situations"]["simulated"]}


@pytest.mark.parametrize("network", PARAMS["methods"]["networks"])
def test_a_fold_is_tested_with_its_own_weights(network, monkeypatch):
    """Those of other folds have been trained on some of its test places."""
    monkeypatch.setattr(evaluate, "forecaster", lambda weights, *_, **__: Mock(weights=weights))
    cfg = OmegaConf.create(PARAMS)
    trials = evaluate.trials_of_network(cfg, network, "folds")
    used = {at: trial.forecaster.weights for at, _, trial in trials}
    folds = [(fold, at) for fold, row in FOLDS["real"].items() for at in row["test"]]
    architecture = PARAMS["methods"]["networks"][network]["settings"]["architecture"]
    expected = {at: Path(f"models/{architecture}_folds", network, fold) for fold, at in folds}
    assert used == expected


def test_no_two_places_are_one_recording():
    rows = PARAMS["places"].values()
    named = [(row["folder"], *(v for v in row["settings"].values() if isinstance(v, str))) for row in rows]
    assert len(set(named)) == len(named)


def test_what_a_place_is_measured_with_was_tuned_elsewhere():
    for place, row in PARAMS["places"].items():
        for group, prefix in (("tracker", "tuned_on_"), ("social_force", "fitted_on_")):
            assert row[group].startswith(prefix), place
            assert row[group] != f"{prefix}{place}"


def test_simulated_sets_have_seeds_of_their_own():
    seeds = [row["seed"] for row in PARAMS["simulations"].values()]
    assert len(set(seeds)) == len(seeds)


def test_no_forecast_moves_when_the_future_does():
    """The whole chain: tracker, features, encoder, recurrent network."""
    torch.manual_seed(0)
    encoder, network = GridAutoencoder(60, 64).eval(), NETWORK.build(WIDTHS, 10).eval()
    sizes, now = ForecastProtocol(), 8.0
    scene = walled_scene(np.random.default_rng(0))

    def forecast(trajectories):
        seen = replace(scene, trajectories=trajectories)
        request = find_windows(seen, Perception(KalmanSettings(0.1, 0.1), 0.2), sizes).request
        asked = replace(request, rows=np.arange(len(request.table)))
        return asked.table.time_s, forecaster_of(network, encoder.encoder)(asked).point

    later = scene.trajectories.time_s > now
    noise = np.random.default_rng(1).normal(0, 3, (len(later), 2))
    moved = scene.trajectories.position + later[:, None] * noise
    time_s, before = forecast(scene.trajectories)
    _, after = forecast(replace(scene.trajectories, position=moved))
    past = time_s <= now
    assert past.any()
    np.testing.assert_allclose(before[past], after[past], rtol=0, atol=1e-6)
    assert np.abs(before[~past] - after[~past]).max() > 0.01
