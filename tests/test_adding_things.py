"""A network, inputs, a metric, source, place, method, fold and world, added to a copy of the project."""

import hashlib
import inspect
import json
import re
import sys

import numpy as np
import pytest

from pedpred import config
from pedpred.evaluation.forecasts import read_windows
from pedpred.simulation.worlds import bottlenecks
from pedpred.storage.checkpoints import read_checkpoint
from pedpred.storage.scenes import read_scene
from stages.config import write_shared
from tests.configuration import read
from tests.conftest import ROOT
from tests.exported import write_autoencoder
from tests.toys import architecture, metric, source
from tests.trust.project import done

PARAMS, WORLDS, SENSING = (
    read("params.yaml"),
    read("conf/worlds/varied.yaml"),
    read("conf/sensing/varied.yaml"),
)
PLACE = {"source": "toy", "folder": "data/raw/toy", "settings": {"dt_s": 0.4}, "variants": []}
PLACE = next(iter(PARAMS["places"].values())) | PLACE
FOLD = {"train": ["real/toy"], "test": ["real/toy"]}
NETWORK = {"where": ["real"], "settings": {"architecture": "toy", "units": 6}}
READS = {"settings": NETWORK["settings"] | {"channels_read": ["state", "crowd"]}}
CROWD = "+methods.networks.lstm.settings.channels.crowd={projection: 4, lstm: 4}"
CHECK = """
import sys, yaml
from pathlib import Path
from pedpred.config import composed
from stages.config import check_parts
check_parts(yaml.safe_load(composed(Path("conf"), sys.argv[1:])))
"""
METHOD = {"where": ["real"], "settings": {"baseline": "kalman_cv"}}
WORLD = {
    "kind": "toy",
    "input": "data/config.checked",
    "worlds": 1,
    "rows": 9,
    "true_rows": 0,
    "true_share": 0.0,
}
TRAININGS = """
toy_main:
  {architecture: toy, phase: corridor, rows: data/rows/lstm/simulated, embeddings: data/embeddings/simulated,
   encoder: models/autoencoder, previous: data/config.checked, curves: reports/curves/sim/toy_main}
toy_folds:
  {architecture: toy, phase: finetune, folds: real, rows: data/rows/lstm, embeddings: data/embeddings,
   encoder: models/autoencoder, previous: models/toy_main, curves: reports/curves/real/toy_folds}
"""
SHOWN = {"label": "Toy network", "colour": "#123456", "role": "network"}
SMALL = [f"training.{p}.{k}" for p in ("corridor", "finetune") for k in ("steps=8", "validate_every=4")]
SMALL += ["training.corridor.sets=[real/toy]"]
OTHERS = [f"~folds.real.{fold}" for fold in PARAMS["folds"]["real"]]
OTHERS += [f"methods.networks.{name}.where=[]" for name in PARAMS["methods"]["networks"]]
OTHERS += ["~folds.sim", "~folds.transfer"]
OTHERS += [f"~places.{name}" for name in PARAMS["places"]]
OTHERS += [f"~situations.simulated.{name}" for name in PARAMS["situations"]["simulated"]]
EXPORT = f"network: toy, weights: models/toy_folds/toy/toy, tracker: {PLACE['tracker']}"
OTHERS += [f"+online.exports.toy={{{EXPORT}}}"]
TOY = {"name": "toy"}
RUNS = [
    ("fetch", TOY),
    ("ingest", TOY),
    ("rows", {"name": "lstm", "kind": "real"}),
    ("rows", {"name": "mixture", "kind": "simulated"}),
    ("train", {"name": "toy_main"}),
    ("train", {"name": "toy_folds", "fold": "toy"}),
    *(("evaluate", {"name": name, "weights": "baselines"}) for name in ("cv", "kalman_cv", "again")),
    ("evaluate", {"name": "toy", "weights": "folds"}),
    ("gather", {"name": "real"}),
    ("report", {}),
    ("export", TOY),
]
STAGES = """
import importlib, json, sys
from pathlib import Path
from omegaconf import OmegaConf
from pedpred.config import composed
overrides, runs = json.loads(sys.argv[1])
common = OmegaConf.create(composed(Path("conf"), overrides))
for stage, arguments in runs:
    common.update(arguments)
    importlib.import_module(f"stages.{stage}").main.__wrapped__(common)
    for name in arguments:
        del common[name]
"""
ROBOT = """
from pedpred.online import OnlinePredictor
from pedpred.online.replay import replay_scene
from pedpred.storage.scenes import read_scene
scene = read_scene(Path("data/scenes/real/toy"))
*_, last = replay_scene(scene, OnlinePredictor.load(Path("models/online/toy")))
print(json.dumps([last.predictions.modes, last.predictions.weight[:, 1].tolist()]))
"""


class Instead(str):
    """Takes the place of a line."""


FEATURES = {
    '            "occupancy": StoredColumn': '            "crowd": StoredColumn("float32", (1,)),',
    "        )  # fmt: skip": "        crowd = np.float32(angular < self.max_range_m).mean(1, keepdims=True)",
    '        return {"state": velocity': Instead(
        '        return {"state": velocity, **crops, "crowd": crowd, "angular_grid": angular}'
    ),
    '        return {"state": stored': Instead(
        '        return {name: stored[name] for name in ("state", "crowd")} | '
        '{"angular": self.closeness(stored["angular_grid"])}'
    ),
    '        return {"state": (2,)': Instead(
        '        return {"state": (2,), "crowd": (1,), "crop": (self.grid_cells,) * 2, '
        '"angular": (self.angular_cells,)}'
    ),
}


def people():
    """Lines `time id x y` of twelve people who walk straight across at their own speeds."""
    rng, lines = np.random.default_rng(0), []
    for track in range(12):
        velocity, start = rng.normal(0, 0.9, 2), rng.uniform(-4, 4, 2)
        for step in range(24):
            lines.append(
                "{} {} {} {}\n".format(0.4 * (step + track), track, *(start + 0.4 * step * velocity))
            )
    return "".join(lines)


def additions():
    """What to add -> file -> texts, each behind or instead of the line with a beginning ("": at the end)."""
    sums = [f"{hashlib.sha256(people().encode()).hexdigest()} people.txt"]
    mirror = {"folders": ["mirror"], "archives": [], "timeout_s": 1, "optional": [], "sha256sums": sums}
    world = inspect.getsource(bottlenecks).replace("Bottleneck", "Toy").replace("bottleneck", "toy")
    worlds = "from pedpred.simulation.worlds"
    after, toy = f"{worlds}.squares", f"{worlds}.toy import ToySettings"
    entry = '    "overshoot_m": Metric("overshoot", "m", "lower", overshoot),'
    return {
        "network": {
            "pedpred/models/toy.py": {"": inspect.getsource(architecture)},
            "conf/methods/networks.yaml": {"": f"toy: {json.dumps(NETWORK)}"},
            "pedpred/models/__init__.py": {
                "ARCHITECTURES =": '    "toy": Architecture("pedpred.models.toy.ToySettings", "lstm"),',
            },
            "conf/trainings/curriculum.yaml": {"": TRAININGS},
        },
        "input channel of the LSTM": {
            "pedpred/models/lstm/network.py": {
                "CHANNELS = ": Instead('CHANNELS = ("state", "grid", "angular", "crowd")')
            },
            "pedpred/models/lstm/features/__init__.py": FEATURES,
            "conf/methods/networks.yaml": {"toy:": Instead(f"toy: {json.dumps(NETWORK | READS)}")},
        },
        "metric": {
            "pedpred/metrics/table.py": {
                '"""(predictions': inspect.getsource(metric.overshoot),
                "METRICS:": entry,
            }
        },
        "source": {
            "pedpred/sources/toy.py": {"": inspect.getsource(source)},
            "conf/mirrors/toy.yaml": {"": json.dumps(mirror)},
            "pedpred/sources/__init__.py": {
                "from pedpred.scenes": "from pedpred.sources import toy",
                "SOURCES:": '    "toy": toy.read_people,',
            },
            "conf/config.yaml": {"mirrors:": "  toy: conf/mirrors/toy.yaml"},
        },
        "place": {"conf/places/recorded.yaml": {"": f"toy: {json.dumps(PLACE)}"}},
        "method row": {"conf/methods/baselines.yaml": {"": f"again: {json.dumps(METHOD)}"}},
        "kind of simulated world": {
            "pedpred/simulation/worlds/toy.py": {"": world},
            "pedpred/simulation/worlds/world.py": {
                after: f"{worlds}.toy import set_up_toy",
                "_SET_UP:": '    "toy": set_up_toy,',
            },
            "pedpred/simulation/worlds/settings.py": {
                after: toy,
                "    warm_up_s:": "    toy: ToySettings",
            },
            "conf/worlds/varied.yaml": {"": f"toy: {json.dumps(WORLDS['bottleneck'])}"},
            "conf/sensing/varied.yaml": {"views:": f"  toy: {json.dumps(SENSING['views']['bottleneck'])}"},
            "conf/situations/varied.yaml": {"simulated:": f"  toy: {json.dumps(WORLD)}"},
        },
        "label and colour": {"conf/report/methods.yaml": {"": f"toy: {json.dumps(SHOWN)}"}},
        "fold": {"conf/folds/leave_one_out.yaml": {"real:": f"  toy: {json.dumps(FOLD)}"}},
    }


def add(file, texts):
    lines = file.read_text().splitlines() if file.exists() else []
    for beginning, text in texts.items():
        behind = [number for number, line in enumerate(lines, 1) if line.startswith(beginning)]
        at = behind[0] if beginning else len(lines)
        lines[at - isinstance(text, Instead) : at] = [text]
    file.write_text("\n".join(lines) + "\n")


def run(folder, *command):
    ended = done(folder, *command, PEDPRED_JOBS="1")
    assert ended.returncode == 0, f"{command}\n{ended.stdout}\n{ended.stderr}"
    return ended.stdout


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A copy of the project with all additions; what git says that each of them touched."""
    folder, touched = tmp_path_factory.mktemp("toys") / "project", {}
    run(ROOT, ".ci/copy", str(folder))
    for kind, files in {"": {}, **additions()}.items():
        for name, texts in files.items():
            add(folder / name, texts)
        run(folder, "git", "add", "--all")
        touched[kind] = set(run(folder, "git", "diff", "--staged", "--name-only").split())
        run(folder, "git", "commit", "--quiet", "--message", f"added: {kind}")
    (folder / "params.yaml").write_text(config.composed(folder / "conf", []))
    write_shared(config.read_params(folder), folder)
    return folder, touched


@pytest.fixture(scope="module")
def reproduced(project):
    """The copy after its stages have run on the toy place, and what a robot then said there."""
    folder, _ = project
    (folder / "mirror").mkdir()
    (folder / "mirror/people.txt").write_text(people())
    write_autoencoder(folder / "models/autoencoder")
    asked = json.dumps([["scale=smoke", *SMALL, *OTHERS], RUNS])
    said = run(folder, sys.executable, "-c", STAGES + ROBOT, asked)
    return folder, json.loads(said.splitlines()[-1])


def table_of_additions():
    """Rows of ARCHITECTURE's table: what to add -> (files to write, how many, files of entries)."""
    table = (ROOT / "ARCHITECTURE.md").read_text().partition("## Adding things")[2]
    rows = re.findall(r"^\| ([^|]+) \| ([^|]+) \| (\d+) \|([^|]*)\|", table, re.MULTILINE)
    named = re.compile(r"`((?:pedpred|conf|tests)/[^`]+)`")
    return {kind: (named.findall(files), int(n), named.findall(entries)) for kind, files, n, entries in rows}


@pytest.mark.parametrize("kind", additions())
def test_the_table_of_what_to_add_counts_right(project, kind):
    files, stated, entries = table_of_additions()[kind]
    named = {file.replace("<name>", "toy") for file in (*files, *entries)}
    assert (project[1][kind], stated) == (named, len(files))


def test_the_table_of_what_to_add_names_files_that_exist():
    for files, stated, entries in table_of_additions().values():
        assert stated == len(files)
        assert all(list(ROOT.glob(file.replace("<name>", "*"))) for file in (*files, *entries)), files


@pytest.mark.parametrize(
    "kind",
    [
        *(
            "fetch@toy",
            "ingest@toy",
            "evaluate@toy",
            "train@toy_main",
            "train@toy_folds",
            "evaluate_baseline@again",
        ),
    ],
)
def test_an_addition_has_its_stages(project, kind):
    assert config.declared(project[0], kind, []) is not None


def test_a_new_channel_may_be_read_by_the_recurrent_network(project):
    run(project[0], sys.executable, "-c", CHECK, CROWD, "~folds.real.toy")


def test_a_new_kind_of_world_is_simulated(reproduced):
    shards = [path.stem for path in (reproduced[0] / "data/rows/mixture/simulated/toy").glob("*.parquet")]
    assert shards == ["toy_000"]


def test_a_new_network_is_trained_and_evaluated_with_all_its_modes(reproduced):
    folder, _ = reproduced
    before, after = (
        read_checkpoint(folder / "models" / name) for name in ("toy_main/toy", "toy_folds/toy/toy")
    )
    assert not np.array_equal(before[0]["out.weight"], after[0]["out.weight"])
    assert before[0]["read.weight"].shape == (6, 3), "it reads the velocity and the new channel"
    windows = read_windows(folder / "data/forecasts/folds/toy/toy/real/toy/toy.parquet")
    assert windows.predictions["toy"].modes == 2
    np.testing.assert_allclose(windows.predictions["toy"].weight[:, 1], 1 / 3, atol=1e-4)


def test_a_new_metric_stands_beside_the_others_for_every_method(reproduced):
    measured = json.loads((reproduced[0] / "reports/metrics/real.json").read_text())["toy"]
    assert "toy" in measured
    assert measured["again"] == measured["kalman_cv"] != measured["cv"]  # the row names this baseline
    for method in measured.values():
        low, high = method["overshoot_m_ci95"]
        assert low <= method["overshoot_m"] <= high


def test_new_methods_and_metrics_are_reported_by_their_labels(reproduced):
    page = (reproduced[0] / "reports/real.md").read_text()
    assert all(label in page for label in ("Toy network", "again", "overshoot"))


def test_a_new_network_runs_on_the_robot(reproduced):
    folder, (modes, weight) = reproduced
    scene = read_scene(folder / "data/scenes/real/toy")
    assert len(np.unique(scene.trajectories.track_id)) == 12
    assert modes == 2
    np.testing.assert_allclose(weight, 1 / 3, atol=0.01)
