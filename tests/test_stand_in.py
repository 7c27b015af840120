"""A simulated place stands in where no place has a recording, and is marked as simulated."""

import hashlib
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from omegaconf import OmegaConf

from pedpred import config
from pedpred.scenes import Scene
from pedpred.sources.scene_folder import read_own
from pedpred.storage.scenes import read_scene, write_scene
from stages import ingest
from stages.worlds import worlds_of
from tests.configuration import composed, read
from tests.conftest import ROOT
from tools import fit_social_force, recordings, stand_in, tune_tracker

NAME = "simulated_corner"
SAME_S = 10.0
"""Processors round differently, and walking people amplify it; up to here positions agree to a millimetre."""
NEEDED = ("_self_", "places:", "folds:", "recording:", "stand_in:", "override")
WALK = b"0 1 2.0 3.0\n"


def test_its_recording_is_what_the_command_writes(tmp_path):
    stand_in.main(["--out", str(tmp_path / "made")])
    committed, made = ROOT / stand_in.FOLDER, tmp_path / "made"
    for path in committed.glob("[!t]*"):  # all but tracks
        assert (made / path.name).read_bytes() == path.read_bytes(), path
    one, other = (read_own(folder).trajectories for folder in (committed, made))
    early = one.time_s < SAME_S
    np.testing.assert_allclose(one.position[early], other.position[other.time_s < SAME_S], atol=0.0015)
    assert worlds_of(read("params.yaml"))[0].seed != stand_in.SEED  # no network is trained in its world


def test_option_adds_a_place_that_is_tested_and_never_trained_on():
    usual, chosen = composed(), composed(f"stand_in={NAME}")
    assert usual == composed("stand_in=none")
    assert chosen["places"].keys() - usual["places"].keys() == {NAME}
    (fold,) = chosen["folds"]["real"].keys() - usual["folds"]["real"].keys()
    assert chosen["folds"]["real"][fold] == {"train": [], "test": [f"real/{NAME}"]}


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A folder with places, folds and the stand-in of the configuration, and a data set for each of two
    places, neither of which can be found."""
    shutil.copytree(ROOT / "conf", tmp_path / "conf")
    lines = (ROOT / "conf/config.yaml").read_text().splitlines(keepends=True)
    kept = [line for line in lines if not line.startswith("  - ") or line.split()[1].startswith(NEEDED)]
    (tmp_path / "conf/config.yaml").write_text("".join(kept))
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PEDPRED_MIRROR", raising=False)
    sums = [f"{hashlib.sha256(WALK).hexdigest()} walk.txt"]
    for name in (names := ("hall", "yard")):
        about = {"folders": [f"mirror/{name}"], "archives": [], "timeout_s": 1.0, "sha256sums": sums}
        Path(f"conf/mirrors/{name}.yaml").write_text(yaml.safe_dump(about | {"optional": []}))
    places = {name: {"folder": f"data/raw/{name}"} for name in names}
    return OmegaConf.create({"mirrors": {n: f"conf/mirrors/{n}.yaml" for n in names}, "places": places})


def put(name):
    Path("mirror", name).mkdir(parents=True)
    Path("mirror", name, "walk.txt").write_bytes(WALK)


@pytest.mark.parametrize("there", [(), ("hall",), ("own",)])
def test_it_stands_in_only_where_no_place_has_a_recording(project, there):
    if "hall" in there:
        put("hall")
    own = {"places": {"own": {"folder": "examples/own"}}} if "own" in there else {}
    recordings.fetch(project)
    recordings.choose_stand_in(OmegaConf.merge(project, own))
    stands_in = NAME in yaml.safe_load(config.composed(Path("conf"), []))["places"]
    assert stands_in is (not there)


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
