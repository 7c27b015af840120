"""An architecture, a data source and a metric, each one file and one registration, through the pipeline."""

import importlib
import json
import re
import shutil

import numpy as np
import pytest
import torch

from pedpred.metrics import METRICS
from pedpred.networks import ARCHITECTURES, load_network
from pedpred.online import OnlinePredictor
from pedpred.online.replay import replayed
from pedpred.sources import SOURCES
from pedpred.storage.scenes import read_scene
from pedpred.storage.windows import read_windows
from tests.conftest import ROOT
from tests.exported import write_autoencoder
from tests.toys.architecture import ToySettings
from tests.toys.metric import METRIC
from tests.toys.source import read_people

PLACE = (
    "+places.toy={source: toy, folder: raw, settings: {dt_s: 0.4}, tracker: tuned_on_eth, sensor: perfect, "
    "social_force: fitted_on_eth, phase_offsets: 1, variants: []}"
)
METHOD = (
    '+methods.networks.toy={label: Toy network, colour: "#123456", role: network, where: [real], '
    "settings: {architecture: toy, units: 6}}"
)
OTHERS = ["methods.networks.lstm.where=[]", "methods.networks.lstm_nogrid.where=[]"]
OTHERS += ["~folds.real.eth", "~folds.real.hotel"]
FOLD = "+folds.real.toy={train: [toy], test: [toy], tracker: tuned_on_eth}"
SMALL = [f"training.{p}.{k}" for p in ("corridor", "finetune") for k in ("steps=8", "validate_every=4")]


def write_raw(folder):
    """Twelve people who walk straight across, at their own speeds."""
    folder.mkdir()
    rng = np.random.default_rng(0)
    rows = []
    for track in range(12):
        velocity, start = rng.normal(0, 0.9, 2), rng.uniform(-4, 4, 2)
        for step in range(24):
            rows.append([0.4 * (step + track), track, *(start + 0.4 * step * velocity)])
    np.savetxt(folder / "people.txt", rows)


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A folder in which the stages have run on a toy place, with a toy network and a toy metric."""
    folder = tmp_path_factory.mktemp("toys")
    write_raw(folder / "raw")
    for name in ("autoencoder", "distilled"):  # the network reads no obstacles, but an export has an encoder
        write_autoencoder(folder / "models" / name)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("PEDPRED_JOBS", "1")  # other processes would not know the toys
        patch.delenv("DVC_STAGE", raising=False)
        patch.setitem(ARCHITECTURES, "toy", ToySettings)
        patch.setitem(SOURCES, "toy", read_people)
        patch.setitem(METRICS, "overshoot_m", METRIC)

        def run(stage, *arguments):
            patch.setattr("sys.argv", [stage, "scale=smoke", PLACE, METHOD, *OTHERS, FOLD, *arguments])
            importlib.import_module(f"stages.{stage}").main()

        run("ingest", "+name=toy")
        run("features", "+kind=real", "+name=toy")
        run("train", "+phase=corridor", "+data=real/toy", "+name=toy", "+out=models/main/toy", *SMALL)
        run("train", "+phase=finetune", "+fold=toy", "+name=toy", *SMALL)
        networks = "+networks=models/folds/toy"
        run("evaluate", "+kind=real", "+fold=toy", networks)
        run("gather", "+kind=real", "+out=reports/metrics/real.json")
        run("report", "+name=real", "+kind=real")
        shutil.copytree("data/features/real/toy", "data/features/simulated/main")  # sizes of the features
        run("export", "+kind=real", "+fold=toy", networks, "online.network=toy")
        yield folder


def test_a_new_source_becomes_a_scene(project):
    scene = read_scene(project / "data/scenes/real/toy")
    assert len(np.unique(scene.trajectories.track_id)) == 12


def test_a_new_network_is_trained(project):
    before, after = (load_network(project / "models" / name / "toy") for name in ("main", "folds/toy"))
    assert not torch.equal(before.out.weight, after.out.weight)


def test_a_new_network_is_evaluated_with_all_its_modes(project):
    windows = read_windows(project / "data/forecasts/real/toy/toy.parquet")
    assert windows.predictions["toy"].modes == 2
    np.testing.assert_allclose(windows.predictions["toy"].weight[:, 1], 1 / 3)


def test_a_new_metric_stands_beside_the_others_for_every_method(project):
    measured = json.loads((project / "reports/metrics/real.json").read_text())["toy"]
    assert "toy" in measured
    for method in measured.values():
        low, high = method["overshoot_m_ci95"]
        assert low <= method["overshoot_m"] <= high


def test_a_new_method_and_metric_are_reported_by_their_labels(project):
    page = (project / "reports/real.md").read_text()
    assert "Toy network" in page
    assert "overshoot" in page


@pytest.mark.parametrize("export", ["toy", "toy_distilled"])
def test_a_new_network_runs_on_the_robot(project, export):
    scene = read_scene(project / "data/scenes/real/toy")
    predictor = OnlinePredictor.load(project / "models/online" / export)
    forecast = list(replayed(scene, predictor))[-1]
    assert forecast.predictions.modes == 2
    np.testing.assert_allclose(forecast.predictions.weight[:, 1], 1 / 3, atol=0.01)


def added_files():
    """Rows of ARCHITECTURE's table of what to add: kind -> (files to write, stated number of files)."""
    text = (ROOT / "ARCHITECTURE.md").read_text()
    table = text.partition("## Adding things")[2]
    rows = re.findall(r"^\| ([^|]+) \| ([^|]+) \| (\d+) \|", table, re.MULTILINE)
    named = re.compile(r"`((?:pedpred|conf)/[^`]+)`")
    return {kind.strip(): (named.findall(files), int(n)) for kind, files, n in rows}


@pytest.mark.parametrize(
    ("kind", "count"),
    [("network", 2), ("metric", 1), ("source", 2), ("place", 1), ("method row", 1), ("fold", 1)],
)
def test_the_table_of_what_to_add_counts_right(kind, count):
    files, stated = added_files()[kind]
    assert len(files) == stated == count
    for file in files:
        example = file.replace("<name>", {"network": "lstm", "source": "ewap"}.get(kind, "<name>"))
        assert (ROOT / example).is_file()
