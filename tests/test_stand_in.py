"""A simulated place stands in where no place has a recording, and is called what it is."""

import hashlib
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
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

SAME_S = 10.0
"""Processors round differently, and walking people amplify it; up to here positions agree to a millimetre."""


def test_its_recording_is_what_the_command_writes(tmp_path):
    stand_in.main(["--out", str(tmp_path / "made")])
    committed, made = ROOT / stand_in.FOLDER, tmp_path / "made"
    assert sorted(path.name for path in made.iterdir()) == sorted(path.name for path in committed.iterdir())
    for name in ("map.pgm", "map.yaml", "scene.json"):
        assert (made / name).read_bytes() == (committed / name).read_bytes(), name
    one, other = (read_own(folder).trajectories for folder in (committed, made))
    early = one.time_s < SAME_S
    np.testing.assert_array_equal(one.track_id[early], other.track_id[other.time_s < SAME_S])
    np.testing.assert_allclose(one.position[early], other.position[other.time_s < SAME_S], atol=0.0015)


def test_it_is_small_and_says_what_it_is():
    folder = ROOT / stand_in.FOLDER
    assert sum(path.stat().st_size for path in folder.iterdir()) < 100_000
    assert read_own(folder).stand_in.startswith("simulated people")


def test_no_network_is_trained_in_its_world():
    assert worlds_of(read("params.yaml"))[0].seed != stand_in.SEED


def test_the_option_adds_a_place_that_is_tested_and_never_trained_on():
    usual, chosen = composed(), composed("stand_in=simulated_corner")
    assert usual == composed("stand_in=none")
    (name,) = chosen["places"].keys() - usual["places"].keys()
    (fold,) = chosen["folds"]["real"].keys() - usual["folds"]["real"].keys()
    assert chosen["folds"]["real"][fold] == {"train": [], "test": [f"real/{name}"]}
    assert name.startswith("simulated")
    assert all(f"real/{name}" not in fold["test"] for fold in usual["folds"]["real"].values())


NEEDED = ("_self_", "places:", "folds:", "recording:", "stand_in:", "override")
WALK = b"0 1 2.0 3.0\n"


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A folder with places, folds and the stand-in of the configuration, and a data set for each of two
    places; none of them is to be had."""
    shutil.copytree(ROOT / "conf", tmp_path / "conf")
    lines = (ROOT / "conf/config.yaml").read_text().splitlines(keepends=True)
    kept = [line for line in lines if not line.startswith("  - ") or line.split()[1].startswith(NEEDED)]
    (tmp_path / "conf/config.yaml").write_text("".join(kept))
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PEDPRED_MIRROR", raising=False)
    about = {"archives": [], "timeout_s": 1.0, "optional": []}
    about["sha256sums"] = [f"{hashlib.sha256(WALK).hexdigest()} walk.txt"]
    mirrors = {name: about | {"folders": [f"mirror/{name}"]} for name in ("hall", "yard")}
    for name, row in mirrors.items():
        Path(f"conf/mirrors/{name}.yaml").write_text(yaml.safe_dump(row))
    places = {name: {"folder": f"data/raw/{name}"} for name in mirrors}
    files = {name: f"conf/mirrors/{name}.yaml" for name in mirrors}
    return OmegaConf.create({"mirrors": files, "places": places})


def put(name):
    Path("mirror", name).mkdir(parents=True)
    Path("mirror", name, "walk.txt").write_bytes(WALK)


def stands_in():
    return "simulated_corner" in yaml.safe_load(config.composed(Path("conf"), []))["places"]


def test_what_is_missing_is_said_with_what_to_do_and_looked_for_again(project):
    put("hall")
    (advice,) = recordings.fetch(project)
    assert "no raw data of yard: put " in advice
    assert "into the folder mirror/yard" in advice
    assert advice.endswith(f"Details: data/raw/yard/{NOTE}")
    put("yard")
    assert recordings.fetch(project) == []
    assert Path("data/raw/yard/walk.txt").read_bytes() == WALK


@pytest.mark.parametrize("there", [(), ("hall",), ("hall", "yard")])
def test_it_stands_in_only_where_no_place_has_a_recording(project, there):
    for name in there:
        put(name)
    recordings.fetch(project)
    recordings.choose_stand_in(project)
    assert stands_in() is (not there)


def test_it_does_not_stand_in_beside_a_place_of_ones_own(project):
    recordings.fetch(project)
    recordings.choose_stand_in(OmegaConf.merge(project, {"places": {"own": {"folder": "examples/own"}}}))
    assert not stands_in()


@pytest.mark.parametrize("tool", [tune_tracker, fit_social_force])
@pytest.mark.parametrize("kind", ["missing", "simulated"])
def test_nothing_is_fitted_where_no_real_people_were_recorded(tool, kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "params.yaml", tmp_path)
    simulated = replace(read_own(ROOT / stand_in.FOLDER), name="eth")
    scene = {"missing": Scene.without_people("eth", "ask for it"), "simulated": simulated}[kind]
    write_scene(scene, Path("data/scenes/real/eth"))
    with pytest.raises(SystemExit, match={"missing": "ask for it", "simulated": "simulated people"}[kind]):
        tool.main(["eth", "--out", "rows.yaml"])
    assert not Path("rows.yaml").exists()


def test_it_is_ingested_as_what_it_is(tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    name, out = "simulated_corner", tmp_path / "scene"
    cfg = composed("stand_in=simulated_corner") | {"name": name, "out": str(out)}
    ingest.main.__wrapped__(OmegaConf.create(cfg))
    assert json.loads((out / "scene.json").read_text())["stand_in"] == stand_in.MADE
    assert read_scene(out).name == name
