"""What it takes to add things, in a copy of the project: files are counted, and what was added is run.

Files of `tests/toys` are what somebody would write; all else are entries in files that exist.
"""

import json
import re
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch

from pedpred import config
from pedpred.evaluation.forecasts import read_windows
from pedpred.evaluation.windows import find_windows
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception
from pedpred.models import ARCHITECTURES, Architecture
from pedpred.models.features import FEATURES, RowFormat
from pedpred.models.forecaster import NetworkForecaster
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.caution import NEWBORN
from pedpred.online.replay import replay_scene
from pedpred.storage.checkpoints import read_checkpoint
from pedpred.tracking import KalmanBank
from tests.configuration import read
from tests.conftest import ROOT
from tests.exported import TRACKER, widths_of, write_model
from tests.toys.histories import ToyFeatures
from tests.toys.transformer import ToySettings
from tests.trust.project import done
from tests.worlds import walled_scene

PARAMS = read("params.yaml")
PLACE = {"source": "toy", "folder": "data/raw/toy", "settings": {"rate_hz": 25.0, "dt_s": 0.4}}
EXCERPT = "9d32a5e66de6f03315fd8e8c29ef798c7339f8a5b7b6c768b7f4267e09671d6f excerpt.txt"
MIRROR = {"folders": ["examples/zara01"], "archives": [], "timeout_s": 1, "sha256sums": [EXCERPT]}
TRAININGS = """\
toy_main: &toy
  {architecture: toy, phase: situations, rows: data/rows/toy/simulated, embeddings: data/config.checked,
   encoder: data/config.checked, previous: data/config.checked, curves: reports/curves/sim/toy_main}
toy_folds:
  {<<: *toy, phase: adaptation, folds: real, rows: data/rows/toy, previous: models/toy_main,
   curves: reports/curves/real/toy_folds}
"""
WORLDS = "pedpred/simulation/worlds"
WORLD = (ROOT / WORLDS / "bottlenecks.py").read_text()  # the new kind is one that is there, by another name
WORLD = WORLD.replace("Bottleneck", "Toy").replace("bottleneck", "toy")
RANGES = json.dumps(read("conf/worlds/varied.yaml")["bottleneck"])
VIEW = json.dumps(read("conf/sensing/varied.yaml")["views"]["bottleneck"])
SET = "{kind: toy, input: data/config.checked, worlds: 1, rows: 60, true_rows: 0, true_share: 0.0}"


def toy(name):
    return (ROOT / f"tests/toys/{name}.py").read_text()


ADDITIONS = {
    "input set": {
        "pedpred/models/toy_inputs.py": toy("histories"),
        "conf/features/paper.yaml": "toy: {steps: 4, neighbours: 5}\n",
        "pedpred/models/features.py": {
            "import MixtureFeatures\n": "from pedpred.models.toy_inputs import ToyFeatures\n",
            '"mixture": MixtureFeatures': ', "toy": ToyFeatures',
        },
    },
    "network": {
        "pedpred/models/toy.py": toy("transformer"),
        "conf/methods/networks.yaml": "toy: {where: [real], settings: {architecture: toy, units: 16}}\n",
        "conf/trainings/curriculum.yaml": TRAININGS,
        "pedpred/models/__init__.py": {
            "ARCHITECTURES = {\n": '    "toy": Architecture("pedpred.models.toy.ToySettings", "toy"),\n',
        },
    },
    "protocol": {
        "conf/protocol/toy.yaml": "defaults: [causal]\ndt_s: 0.4\nhorizon_steps: 12\n",
    },
    "source": {
        "pedpred/sources/toy.py": toy("source"),
        "conf/mirrors/toy.yaml": json.dumps(MIRROR),
        "pedpred/sources/__init__.py": {
            "from pedpred.scenes import Scene\n": "from pedpred.sources import toy\n",
            "Scene]] = {\n": '    "toy": toy.read_people,\n',
        },
        "conf/config.yaml": {"conf/mirrors/ewap.yaml\n": "  toy: conf/mirrors/toy.yaml\n"},
    },
    "place": {
        "conf/places/recorded.yaml": f"toy: {json.dumps(PARAMS['places']['zara01'] | PLACE)}\n",
    },
    "fold": {
        "conf/folds/leave_one_out.yaml": {"every real place\n": "  toy: {test: [real/toy]}\n"},
    },
    "method row": {
        "conf/methods/baselines.yaml": "again: {where: [real], settings: {baseline: kalman_cv}}\n",
    },
    "metric": {
        "pedpred/metrics/table.py": {
            '-> values [W]"""\n': toy("metric").partition("import numpy as np\n")[2],
            "Metric] = {\n": '    "overshoot_m": Metric("overshoot", "m", "lower", overshoot),\n',
        },
    },
    "kind of simulated world": {
        f"{WORLDS}/toy.py": WORLD,
        "conf/worlds/varied.yaml": f"toy: {RANGES}\n",
        "conf/sensing/varied.yaml": {"each kind of world\n": f"  toy: {VIEW}\n"},
        "conf/situations/varied.yaml": {"simulated:\n": f"  toy: {SET}\n"},
        f"{WORLDS}/world.py": {
            "import set_up_square\n": "from pedpred.simulation.worlds.toy import set_up_toy\n",
            '"room": set_up_room,\n': '    "toy": set_up_toy,\n',
        },
        f"{WORLDS}/settings.py": {
            "import SquareSettings\n": "from pedpred.simulation.worlds.toy import ToySettings\n",
            "room: RoomSettings\n": "    toy: ToySettings\n",
        },
    },
    "label and colour": {
        "conf/report/methods.yaml": "toy: {label: Toy network, colour: '#123456', role: network}\n",
    },
}
"""What to add -> file -> a text at its end, or texts behind what is there."""


def add(file, texts):
    text = file.read_text() if file.exists() else ""
    if isinstance(texts, str):
        text += texts
    else:
        for there, added in texts.items():
            assert there in text
            text = text.replace(there, there + added, 1)
    file.write_text(text)


def run(folder, *command):
    ended = done(folder, *command, PEDPRED_JOBS="1")
    assert ended.returncode == 0, f"{command}\n{ended.stdout}\n{ended.stderr}"
    return ended.stdout


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A copy of the project with all additions; file -> A, added, or M, modified, as git says of each."""
    folder, touched = tmp_path_factory.mktemp("toys") / "project", {}
    run(ROOT, ".ci/copy", str(folder))
    for kind, files in {"": {}, **ADDITIONS}.items():
        for name, texts in files.items():
            add(folder / name, texts)
        run(folder, "git", "add", "--all")
        lines = run(folder, "git", "diff", "--staged", "--name-status").splitlines()
        touched[kind] = dict(reversed(line.split("\t")) for line in lines)
        run(folder, "git", "commit", "--quiet", "--message", f"added: {kind}")
    return folder, touched


def table_of_additions():
    """Rows of ARCHITECTURE's table: what to add -> (files to write, how many, files of entries)."""
    table = (ROOT / "ARCHITECTURE.md").read_text().partition("## Adding things")[2]
    rows = re.findall(r"^\| ([^|]+) \| ([^|]+) \| (\d+) \|([^|]*)\|", table, re.MULTILINE)
    named = re.compile(r"`((?:pedpred|conf|tests)/[^`]+)`")
    return {kind: (named.findall(files), int(n), named.findall(entries)) for kind, files, n, entries in rows}


COUNTS = {
    "input set": (1, 2),
    "network": (1, 3),
    "protocol": (1, 0),
    "source": (2, 2),
    "place": (0, 1),
    "fold": (0, 1),
    "method row": (0, 1),
    "metric": (0, 1),
    "kind of simulated world": (1, 5),
    "label and colour": (0, 1),
}
"""What to add -> new files, and files with a new entry."""


def test_additions_touch_few_files(project):
    touched = {kind: [*project[1][kind].values()] for kind in ADDITIONS}
    assert {kind: (states.count("A"), states.count("M")) for kind, states in touched.items()} == COUNTS


@pytest.mark.parametrize("kind", ADDITIONS)
def test_additions_touch_the_files_of_the_table(project, kind):
    files, stated, entries = table_of_additions()[kind]
    touched = {file.replace("toy_inputs", "<name>").replace("toy", "<name>") for file in project[1][kind]}
    assert (touched, stated) == ({*files, *entries}, len(files))


def test_files_of_the_table_exist():
    for files, stated, entries in table_of_additions().values():
        assert stated == len(files)
        assert all(list(ROOT.glob(file.replace("<name>", "*"))) for file in (*files, *entries)), files


def test_rows_of_additions_have_stages(project):
    (project[0] / "params.yaml").write_text(config.composed(project[0] / "conf", []))
    places = {"fetch@toy", "ingest@toy", "evaluate_baseline@again"}
    networks = {"rows@toy-simulated", "train@toy_main", "train@toy_folds", "evaluate@toy"}
    assert places | networks <= set(config.declarations(project[0]))


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
SETS, ROWS = PARAMS["situations"]["simulated"], PARAMS["methods"]
LITTLE = [
    *("scale=smoke", "~folds.sim", "~folds.real", "~folds.transfer.simulation"),
    *(f"~situations.simulated.{name}" for name in SETS),
    *(f"~training.situations.shares.{name}" for name in SETS),
    "+training.situations.shares.toy=1.0",
    *(f"methods.networks.{name}.where=[]" for name in ROWS["networks"]),
    *(f"methods.baselines.{name}.where=[]" for name in ("ca", "social_force")),
]
RUNS = [
    *(("fetch", {"name": "toy"}), ("ingest", {"name": "toy"})),
    *(("rows", {"name": "toy", "kind": "simulated"}), ("train", {"name": "toy_main"})),
    *(("evaluate", {"name": name, "weights": "baselines"}) for name in ("cv", "kalman_cv", "again")),
    *(("evaluate", {"name": "toy", "weights": "main"}), ("gather", {"name": "transfer"})),
]


@pytest.fixture(scope="module")
def reproduced(project):
    """The copy after the stages have run with all additions, under the new protocol."""
    run(project[0], sys.executable, "-c", STAGES, json.dumps([["protocol=toy"], LITTLE, RUNS]))
    return project[0]


@pytest.mark.slow
def test_rows_hold_the_new_inputs_of_the_new_world(reproduced):
    about = json.loads((reproduced / "data/rows/toy/simulated/toy/manifest.json").read_text())
    shapes = {name: column["shape"] for name, column in about["columns"].items()}
    assert shapes == {"velocity": [2], "own": [15], "others": [75], "future": [12, 2]}
    assert list(about["shards"]) == ["toy_000"]


@pytest.mark.slow
def test_a_new_network_is_trained(reproduced):
    weights, _ = read_checkpoint(reproduced / "models/toy_main/toy")
    assert weights["token.weight"].shape == (16, 15)
    curve = pd.read_csv(reproduced / "reports/curves/sim/toy_main/main_toy.tsv", sep="\t")
    assert list(curve["step"]) == [0, 5, 10]
    assert curve["train_loss"][1:].notna().all()


@pytest.mark.slow
def test_a_new_network_is_evaluated_under_a_new_protocol(reproduced):
    windows = read_windows(reproduced / "data/forecasts/main/toy/real/toy/toy.parquet")
    forecasts = windows.predictions["toy"]
    assert (forecasts.steps, windows.dt_s) == (12, 0.4)
    assert len(forecasts) == len(windows.truth) > 50


@pytest.mark.slow
def test_new_methods_and_metrics_stand_beside_the_others(reproduced):
    measured = json.loads((reproduced / "reports/metrics/transfer.json").read_text())["toy"]
    assert set(measured) == {"cv", "kalman_cv", "again", "toy"}
    assert measured["again"] == measured["kalman_cv"] != measured["cv"]  # the row names this baseline
    for method in measured.values():
        low, high = method["overshoot_m_ci95"]
        assert low <= method["overshoot_m"] <= high


def test_a_new_input_set_is_the_same_on_a_robot(monkeypatch, tmp_path):
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
    offline = NetworkForecaster(network, made_with.features, None)(everybody)
    how = replace(OnlineSettings.as_offline(made_with.protocol, scene.detection_dt_s), learn_trust=False)
    compared = 0
    for forecast in replay_scene(scene, OnlinePredictor.load(tmp_path, how)):
        now = np.abs(table.time_s - forecast.time_s) < 1e-6
        now = np.flatnonzero(now & (table.step >= NEWBORN))  # a robot forecasts who is new to stand
        own = np.searchsorted(forecast.track_id, table.track_id[now])
        np.testing.assert_allclose(forecast.position[own], offline.point[now], atol=1e-4)
        compared += len(now)
    assert compared == (table.step >= NEWBORN).sum() > 100
