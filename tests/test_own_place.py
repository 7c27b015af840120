"""A recording of one's own, named in the configuration, flows through every stage; no code is needed."""

import copy
import importlib
import json
import shutil
from functools import cache
from pathlib import Path

import pandas as pd
import pytest
import torch
import yaml
from omegaconf import OmegaConf
from PIL import Image

from pedpred import config
from pedpred.errors import InputError
from pedpred.files import write_json
from pedpred.models.registry import parse_settings
from pedpred.storage.scenes import read_scene
from stages.config import write_shared
from tests.conftest import ROOT
from tests.exported import MIXTURE_ROWS, WIDTHS, widths_of, write_autoencoder, write_network

NETWORKS = ("lstm", "lstm_nogrid")
METHODS = {"cv", "kalman_cv", *NETWORKS, "mixture", "mixture_small"}
WIDTHS_OF = ("joint", "head", "channels.state.lstm", "channels.angular.lstm")
SMALL = [
    *("scale=smoke", "training.finetune.lanes=8", "methods.networks.lstm.settings.channels.grid.lstm=8"),
    *(f"methods.networks.{n}.settings.{width}=8" for n in NETWORKS for width in WIDTHS_OF),
    *(f"methods.baselines.{m}.where=[]" for m in ("ca", "social_force")),
]
WALKING = json.loads((ROOT / "reports/metrics/walking.json").read_text())["corridor_flow"]
SHOWN_S = 8.0
"""Seconds of the example that are enough to train, to test and to draw."""
UNAVAILABLE = "no raw data of eth: the archive is down"

pytestmark = pytest.mark.slow


@cache
def configured(text):
    """A configuration as stages get it; to make it takes longer than many a stage."""
    return OmegaConf.create(json.loads(text))


def run(script, cfg, **given):
    """A stage's script in this process."""
    stage, seen = importlib.import_module(f"stages.{script}"), configured(json.dumps(cfg))
    seen.update(given)
    try:
        stage.main.__wrapped__(seen)
    finally:
        for key in given:
            del seen[key]


def bring(project, name):
    """Bring a place as far as training."""
    run("ingest", project, name=name)
    alone = project | {"places": {name: project["places"][name]}}
    for features in project["features"]:
        run("rows", alone, name=features, kind="real")
    run("embed", project, rows="data/rows/lstm/real", out="data/embeddings/real")


def evaluate(project):
    """Test all methods."""
    for group, tested in {"baselines": ["baselines"], "networks": ["main", "folds"]}.items():
        for name in project["methods"][group]:
            for weights in tested:
                run("evaluate", project, name=name, weights=weights)


def report(project):
    """Write all pages; those on simulations are of other tests."""
    project["folds"].pop("sim", None)
    write_json(Path("reports/metrics/walking.json"), {"corridor_flow": WALKING})
    Path("reports/simulation.md").write_text("# simulation\n")
    run("report", project)


def rows():
    """The rows of conf/places and conf/folds that docs/places.md gives for the example."""
    page = (ROOT / "docs/places.md").read_text()
    return [part.partition("```")[0] for part in page.split("```yaml\n")[1:3]]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with the configuration, the example as a place of one's own and untrained networks."""
    folder = tmp_path_factory.mktemp("made")
    for name in ("conf", "examples"):
        shutil.copytree(ROOT / name, folder / name)
    tracks = pd.read_csv(file := folder / "examples/crossing/tracks.csv")
    tracks[tracks["time"] <= SHOWN_S].to_csv(file, index=False)
    shutil.copy(ROOT / "dvc.yaml", folder)
    for name, row in zip(("places/recorded.yaml", "folds/leave_one_out.yaml"), rows(), strict=True):
        with (folder / "conf" / name).open("a") as file:
            file.write(row)
    text = config.composed(folder / "conf", SMALL)
    (folder / "params.yaml").write_text(text)
    write_shared(config.read_params(folder), folder)
    params = yaml.load(text, yaml.CSafeLoader)
    own = {"crossing": params["folds"]["real"]["crossing"]}  # raw data of other places are not part of this
    params["folds"]["real"] = own
    torch.manual_seed(0)
    write_autoencoder(folder / "models/autoencoder")
    for name, method in params["methods"]["networks"].items():
        is_mixture = method["settings"]["architecture"] == "mixture"
        settings = method["settings"] | ({"units": 8} if is_mixture else {})
        widths = widths_of(MIXTURE_ROWS.features) if is_mixture else WIDTHS
        network = parse_settings(settings).build(widths, params["protocol"]["horizon_steps"])
        kind = method["settings"]["architecture"]
        for trained in (
            f"{kind}_main/{name}",
            *(f"{kind}_folds/{name}/{fold}" for fold in ("crossing", "fold")),
        ):
            write_network(folder / "models" / trained, network, *([MIXTURE_ROWS] if is_mixture else []))
    return folder, params


@pytest.fixture
def project(made, tmp_path, monkeypatch):
    """A copy of that folder is the current one; its parameters, to be changed."""
    shutil.copytree(made[0], tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PEDPRED_JOBS", "1")
    return copy.deepcopy(made[1])


def missing(project, place):
    """Note that nobody has a place's raw files, and bring the place as far as training."""
    note = Path(project["places"][place]["folder"], "UNAVAILABLE.txt")
    note.parent.mkdir(parents=True)
    note.write_text(f"{UNAVAILABLE}\nTried was nothing.\n")
    bring(project, place)


def test_own_place_flows_from_tracks_to_the_page(project, monkeypatch):
    """Every picture is composed, but only those of the page are painted, which takes most of the time."""
    monkeypatch.setattr("pedpred.report.document.write_png", lambda figure, path: None)
    assert config.declared(Path(), "ingest@crossing", []).places.crossing.source == "scene_folder"
    bring(project, "crossing")
    missing(project, "eth")
    trained = {"other": ["crossing"], "missing": ["eth"], "both": ["eth", "crossing"]}
    tested = project["folds"]["real"]
    project["folds"] = {
        "real": tested
        | {
            name: {"train": [f"real/{place}" for place in places], "test": []}
            for name, places in trained.items()
        }
    }
    run("train", project, name="lstm_folds", network="lstm")
    curve = pd.read_csv("reports/curves/real/lstm_folds/finetune_other_lstm.tsv", sep="\t")
    assert curve["validation_ade_m"].notna().all()
    before, other, without, both = (
        Path("models", folder, "weights.safetensors").read_bytes()
        for folder in ("lstm_main/lstm", *(f"lstm_folds/lstm/{fold}" for fold in trained))
    )
    assert without == before
    assert both == other != before
    project["folds"] = {"real": tested}
    run("train", project, name="lstm_folds", fold="crossing")
    with pytest.raises(InputError) as refused:
        run("gather", project, name="real")
    assert refused.value.where == "scores"
    assert not Path("reports/metrics").exists()  # figures stay while nothing is evaluated
    evaluate(project)
    run("gather", project, name="real")
    figures = json.loads(Path("reports/metrics/real.json").read_text())
    assert set(figures) == {"crossing"}
    assert set(figures["crossing"]) == METHODS
    assert 0.1 < figures["crossing"]["kalman_cv"]["ade_m"] < 2.0
    report(project)
    assert "crossing" in Path("reports/real.md").read_text().lower()
    assert json.loads(Path("reports/ade/real.json").read_text())["crossing"]


def test_a_missing_place_is_in_no_result(project, monkeypatch):
    """Pages are of text here; the test of the flow draws their pictures, which takes most of the time."""
    monkeypatch.setattr("pedpred.report.gallery.snapshot_figure", lambda *_: None)
    monkeypatch.setattr("pedpred.report.document.write_png", lambda figure, path: None)
    monkeypatch.setattr("stages.report.render_page", lambda contents: "")
    missing(project, "eth")
    scene = read_scene(Path("data/scenes/real/eth"))
    assert (scene.unavailable, len(scene.trajectories)) == (UNAVAILABLE, 0)
    project["folds"] = {
        "transfer": {"simulation": {"test": ["real/eth"]}},
        "real": {"fold": {"train": [], "test": ["real/eth"]}},
    }
    run("train", project, name="lstm_folds")
    evaluate(project)
    for study in ("transfer", "real"):
        run("gather", project, name=study)
        assert json.loads(Path(f"reports/metrics/{study}.json").read_text()) == {}
    report(project)
    for page in ("real", "report"):
        assert f"| eth | {UNAVAILABLE} |" in Path(f"reports/{page}.md").read_text()
    for folder in ("real", "horizon/real", "places"):  # DVC expects them
        assert Path("reports", folder).is_dir()
    run("record", project, scene="real/eth", networks="fold")
    assert Path("data/recordings/eth.mcap").read_bytes().startswith(b"\x89MCAP")
    with Image.open("reports/walking/eth.gif") as picture:
        assert picture.n_frames == 1
