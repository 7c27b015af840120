"""A simulated place stands in where no place has a recording, and is marked as simulated."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from omegaconf import OmegaConf

from pedpred import config
from pedpred.scenes import Scene
from pedpred.sources.mirrors import NOTE
from pedpred.sources.scene_folder import read_own
from pedpred.storage.scenes import read_scene, write_scene
from stages import ingest
from stages.worlds import worlds_of
from tests.configuration import composed, read
from tests.conftest import ROOT
from tools import fit_social_force, recordings, stand_in, tune_tracker

NAME = "simulated_corner"


def test_option_adds_a_place_that_is_tested_and_never_trained_on():
    usual, chosen = composed(), composed(f"stand_in={NAME}")
    assert usual == composed("stand_in=none")
    assert chosen["places"].keys() - usual["places"].keys() == {NAME}
    (fold,) = chosen["folds"]["real"].keys() - usual["folds"]["real"].keys()
    assert chosen["folds"]["real"][fold] == {"train": [], "test": [f"real/{NAME}"]}
    assert worlds_of(read("params.yaml"))[0].seed != stand_in.SEED  # no network is trained in its world


@pytest.mark.parametrize("there", [True, False])
def test_it_stands_in_only_where_no_place_has_a_recording(there, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "conf", "conf")
    places = {name: {"folder": f"data/raw/{name}"} for name in ("hall", "yard")}
    for name in ("yard",) if there else places:
        Path("data/raw", name).mkdir(parents=True)
        Path("data/raw", name, NOTE).touch()
    recordings.choose_stand_in(OmegaConf.create({"places": places}))
    assert (NAME in yaml.safe_load(config.composed(Path("conf"), []))["places"]) is not there


@pytest.mark.parametrize("tool", [tune_tracker, fit_social_force])
@pytest.mark.parametrize("kind", ["missing", "simulated"])
def test_nothing_is_fitted_where_no_real_people_are(tool, kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "params.yaml", tmp_path)
    simulated = replace(read_own(ROOT / stand_in.FOLDER), name="eth")
    scene = {"missing": Scene.without_people("eth", "ask for it"), "simulated": simulated}[kind]
    write_scene(scene, Path("data/scenes/real/eth"))
    with pytest.raises(SystemExit):
        tool.main(["eth", "--out", "rows.yaml"])
    assert not Path("rows.yaml").exists()


def test_ingested_stand_in_is_marked_as_simulated(tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    cfg = composed(f"stand_in={NAME}") | {"name": NAME, "out": str(tmp_path)}
    ingest.main.__wrapped__(OmegaConf.create(cfg))
    scene = read_scene(tmp_path)
    assert (scene.name, scene.stand_in) == (NAME, stand_in.MADE)
