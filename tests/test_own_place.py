"""A recording of one's own, named in the configuration, flows through every stage; no code is needed."""

import importlib
import json
import shutil
from pathlib import Path

import pandas as pd
import pytest
import torch
import yaml
from omegaconf import OmegaConf

from pedpred import config
from pedpred.networks import GridAutoencoder, parse_settings
from pedpred.networks.registry import write_network
from pedpred.storage.checkpoints import write_checkpoint
from tests.conftest import ROOT
from tests.exported import WIDTHS

SMALL = [
    "scale=smoke",
    *(f"models.{m}.channels.{c}.lstm=8" for m in ("lstm", "lstm_nogrid") for c in ("state", "angular")),
    *(f"models.{m}.{width}=8" for m in ("lstm", "lstm_nogrid") for width in ("joint", "head")),
    "models.lstm.channels.grid.lstm=8",
    "training.finetune.lanes=8",
    "evaluation.baselines.real=[cv,kalman_cv]",
]


def run(script, cfg, **given):
    """A stage's script in this process."""
    stage = importlib.import_module(f"stages.{script}")
    stage.main.__wrapped__(OmegaConf.create({**cfg, **given}))


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A folder with the configuration, the example as a place of one's own and untrained networks."""
    page = (ROOT / "README.md").read_text().partition("this is `conf/scenes/crossing.yaml`:")[2]
    for name in ("conf", "dvc.yaml"):
        (shutil.copytree if (ROOT / name).is_dir() else shutil.copy)(ROOT / name, tmp_path / name)
    (tmp_path / "conf/scenes/crossing.yaml").write_text(page.partition("```yaml\n")[2].partition("```")[0])
    (tmp_path / "data/scenes").mkdir(parents=True)
    shutil.copytree(ROOT / "examples/crossing", tmp_path / "data/scenes/crossing")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PEDPRED_JOBS", "1")
    named = [
        "+scenes@scenes.crossing=crossing",
        "places=[eth,hotel,crossing]",
        "+evaluation.real.crossing=main",
    ]
    text = config.composed(Path("conf"), [*named, *SMALL])
    Path("params.yaml").write_text(text)
    params = yaml.safe_load(text)
    params["evaluation"]["real"] = {"crossing": "main"}  # the raw data of the others are not part of this
    torch.manual_seed(0)
    settings = {"kind": "autoencoder", "settings": {"latent": 64}, "cells": 60}
    write_checkpoint(Path("models/autoencoder"), GridAutoencoder(60, 64).state_dict(), settings)
    for name, model in params["models"].items():
        own = parse_settings(model | {"architecture": "lstm"})
        write_network(Path("models/main", name), own.build(WIDTHS, params["protocol"]["horizon_steps"]))
    return params


def test_it_has_stages_of_its_own(project):
    stages = ("features@crossing", "encode_place@crossing", "finetune@lstm-crossing", "record_real@crossing")
    for address in (*stages, "evaluate_place@crossing"):
        assert config.declared_params(Path(), address) is not None


def test_it_flows_from_tracks_to_the_page(project, monkeypatch):
    """Every picture is composed, but none painted, which would take most of the time."""
    monkeypatch.setattr("stages.report.write_png", lambda figure, path: None)
    run("features", project, name="crossing")
    run("encode", project, name="crossing")
    run("train", project, name="lstm", phase="finetune", data="crossing")
    assert Path("models/finetune_crossing/lstm/weights.safetensors").exists()
    curve = pd.read_csv("reports/curves/real/finetune_crossing_lstm.tsv", sep="\t")
    assert curve["validation_ade_m"].notna().all()
    run("evaluate", project, name="real", place="crossing", metrics="data/metrics/real/crossing.json")
    run("gather", project, name="real")
    figures = json.loads(Path("reports/metrics/real.json").read_text())
    assert set(figures) == {"crossing"}
    assert set(figures["crossing"]) == {"cv", "kalman_cv", "lstm", "lstm_nogrid"}
    assert 0.1 < figures["crossing"]["kalman_cv"]["ade_m"] < 2.0
    run("report", project, name="real")
    assert "crossing" in Path("reports/real.md").read_text().lower()
    assert json.loads(Path("reports/ade/crossing.json").read_text())
