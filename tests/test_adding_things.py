"""What somebody adds by one file and entries: written into a copy of the project, and run there.

Files of `tests/toys` are what somebody would write; all else are entries in files that exist.
"""

import json
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch

from pedpred.evaluation.forecasts import read_windows
from pedpred.evaluation.windows import find_windows
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception
from pedpred.models import ARCHITECTURES, Architecture
from pedpred.models.features import FEATURES, RowFormat
from pedpred.models.forecaster import NetworkForecaster
from pedpred.online import OnlinePredictor
from pedpred.online.caution import NEWBORN
from pedpred.online.replay import replay_scene
from pedpred.storage.checkpoints import read_checkpoint
from pedpred.tracking import KalmanBank
from tests.configuration import read
from tests.conftest import ROOT
from tests.exported import TRACKER, as_offline, widths_of, write_model
from tests.toys.histories import ToyFeatures
from tests.toys.transformer import ToySettings
from tests.trust.project import done
from tests.worlds import walled_scene

PARAMS = read("params.yaml")
PLACE = {"source": "toy", "folder": "data/raw/toy", "settings": {"rate_hz": 25.0, "dt_s": 0.4}}
EXCERPT = "9d32a5e66de6f03315fd8e8c29ef798c7339f8a5b7b6c768b7f4267e09671d6f excerpt.txt"
MIRROR = {"folders": ["examples/zara01"], "archives": [], "timeout_s": 1, "sha256sums": [EXCERPT]}
TRAINING = """\
toy_main:
  {architecture: toy, phase: situations, rows: data/rows/toy/simulated, embeddings: data/config.checked,
   encoder: data/config.checked, previous: data/config.checked, curves: reports/curves/sim/toy_main}
"""


def toy(name):
    return (ROOT / f"tests/toys/{name}.py").read_text()


ADDITIONS = {
    # an input set and a network that reads it
    "pedpred/models/toy_inputs.py": toy("histories"),
    "pedpred/models/toy.py": toy("transformer"),
    "pedpred/models/features.py": {
        "import MixtureFeatures\n": "from pedpred.models.toy_inputs import ToyFeatures\n",
        '"mixture": MixtureFeatures': ', "toy": ToyFeatures',
    },
    "pedpred/models/__init__.py": {
        "ARCHITECTURES = {\n": '    "toy": Architecture("pedpred.models.toy.ToySettings", "toy"),\n',
    },
    "conf/features/paper.yaml": "toy: {steps: 4, neighbours: 5}\n",
    "conf/methods/networks.yaml": "toy: {where: [real], settings: {architecture: toy, units: 16}}\n",
    "conf/trainings/curriculum.yaml": TRAINING,
    "conf/protocol/toy.yaml": "defaults: [causal]\ndt_s: 0.4\nhorizon_steps: 12\n",
    # a source, a place and its fold
    "pedpred/sources/toy.py": toy("source"),
    "pedpred/sources/__init__.py": {
        "from pedpred.scenes import Scene\n": "from pedpred.sources import toy\n",
        "Scene]] = {\n": '    "toy": toy.read_people,\n',
    },
    "conf/mirrors/toy.yaml": json.dumps(MIRROR),
    "conf/config.yaml": {"conf/mirrors/ewap.yaml\n": "  toy: conf/mirrors/toy.yaml\n"},
    "conf/places/recorded.yaml": f"toy: {json.dumps(PARAMS['places']['zara01'] | PLACE)}\n",
    "conf/folds/leave_one_out.yaml": {"every real place\n": "  toy: {test: [real/toy]}\n"},
    # a row of a method, and a metric
    "conf/methods/baselines.yaml": "again: {where: [real], settings: {baseline: kalman_cv}}\n",
    "pedpred/metrics/table.py": {
        '-> values [W]"""\n': toy("metric").partition("import numpy as np\n")[2],
        "Metric] = {\n": '    "overshoot_m": Metric("overshoot", "m", "lower", overshoot),\n',
    },
}
"""File -> a text at its end, or texts behind what is there; as the table in ARCHITECTURE.md says."""
STAGES = """
import importlib, json, sys
from pathlib import Path
from omegaconf import OmegaConf
from pedpred.config import composed
from stages.config import check_parts
everything, little, runs = json.loads(sys.argv[1])
check_parts(OmegaConf.to_container(OmegaConf.create(composed(Path("conf"), everything))))
settings = OmegaConf.create(composed(Path("conf"), everything + little))
for stage, arguments in runs:
    importlib.import_module(f"stages.{stage}").main.__wrapped__(OmegaConf.merge(settings, arguments))
"""
SETS, ROWS = {*PARAMS["situations"]["simulated"]} - {"bottleneck"}, PARAMS["methods"]
LITTLE = [
    *("scale=smoke", "~folds.sim", "~folds.real", "~folds.transfer.simulation"),
    *(f"~situations.simulated.{name}" for name in SETS),
    *(f"~training.situations.shares.{name}" for name in SETS),
    "training.situations.shares.bottleneck=1.0",
    *(f"situations.simulated.bottleneck.{name}" for name in ("worlds=1", "rows=60", "true_rows=0")),
    "situations.simulated.bottleneck.true_share=0.0",
    *(f"methods.networks.{name}.where=[]" for name in ROWS["networks"]),
    *(f"methods.baselines.{name}.where=[]" for name in ("ca", "social_force")),
]
RUNS = [
    *(("fetch", {"name": "toy"}), ("ingest", {"name": "toy"})),
    *(("rows", {"name": "toy", "kind": "simulated"}), ("train", {"name": "toy_main"})),
    *(("evaluate", {"name": name, "weights": "baselines"}) for name in ("cv", "kalman_cv", "again")),
    *(("evaluate", {"name": "toy", "weights": "main"}), ("gather", {"name": "transfer"})),
]


def run(folder, *command):
    ended = done(folder, *command, PEDPRED_JOBS="1")
    assert ended.returncode == 0, f"{command}\n{ended.stdout}\n{ended.stderr}"


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A copy of the project with all additions, after its stages have run under the new protocol."""
    folder = tmp_path_factory.mktemp("toys") / "project"
    run(ROOT, ".ci/copy", str(folder))
    for name, added in ADDITIONS.items():
        text = (folder / name).read_text() if (folder / name).exists() else ""
        for there, behind in added.items() if isinstance(added, dict) else [(text, added)]:
            assert there in text
            text = text.replace(there, there + behind, 1)
        (folder / name).write_text(text)
    run(folder, sys.executable, "-c", STAGES, json.dumps([["protocol=toy"], LITTLE, RUNS]))
    return folder


@pytest.mark.slow
def test_new_network_learns_from_its_inputs(project):
    about = json.loads((project / "data/rows/toy/simulated/bottleneck/manifest.json").read_text())
    shapes = {name: column["shape"] for name, column in about["columns"].items()}
    assert shapes == {"velocity": [2], "own": [15], "others": [75], "future": [12, 2]}
    weights, _ = read_checkpoint(project / "models/toy_main/toy")
    assert weights["token.weight"].shape == (16, 15)
    curve = pd.read_csv(project / "reports/curves/sim/toy_main/main_toy.tsv", sep="\t")
    assert curve["train_loss"][1:].notna().all()


@pytest.mark.slow
def test_new_network_is_evaluated_at_a_new_place(project):
    windows = read_windows(project / "data/forecasts/main/toy/real/toy/toy.parquet")
    forecasts = windows.predictions["toy"]
    assert (forecasts.steps, windows.dt_s) == (12, 0.4)
    assert len(forecasts) == len(windows.truth) > 50
    measured = json.loads((project / "reports/metrics/transfer.json").read_text())["toy"]
    assert set(measured) == {"cv", "kalman_cv", "again", "toy"}
    assert measured["again"] == measured["kalman_cv"] != measured["cv"]  # the row names this baseline
    for method in measured.values():
        low, high = method["overshoot_m_ci95"]
        assert low <= method["overshoot_m"] <= high


def test_new_input_set_is_the_same_on_a_robot(monkeypatch, tmp_path):
    """Neighbours' histories are those that the pipeline sees, and so are the forecasts."""
    monkeypatch.setitem(FEATURES, "toy", ToyFeatures)
    monkeypatch.setitem(ARCHITECTURES, "toy", Architecture(f"{ToySettings.__module__}.ToySettings", "toy"))
    made_with = RowFormat(ForecastProtocol(horizon_steps=4), "toy", ToyFeatures())
    torch.manual_seed(0)
    network = ToySettings().build(widths_of(made_with.features), 4).eval()
    write_model(tmp_path, network, None, made_with)

    scene = walled_scene(np.random.default_rng(1), 0.3)
    request = find_windows(scene, Perception(KalmanBank.around(TRACKER), 0.2), made_with.protocol).request
    table = request.table
    everybody = replace(request, rows=np.arange(len(table)))
    offline = NetworkForecaster(network, made_with.features, None, trust=True, local_errors=True)(everybody)
    how = as_offline(made_with.protocol, scene.detection_dt_s)
    compared = 0
    for forecast in replay_scene(scene, OnlinePredictor.load(tmp_path, how)):
        now = np.abs(table.time_s - forecast.time_s) < 1e-6
        now = np.flatnonzero(now & (table.step >= NEWBORN))  # a robot forecasts who is new to stand
        own = np.searchsorted(forecast.track_id, table.track_id[now])
        np.testing.assert_allclose(forecast.position[own], offline.point[now], atol=1e-4)
        compared += len(now)
    assert compared == (table.step >= NEWBORN).sum() > 100
