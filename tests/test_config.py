"""A stage sees the keys that it declares, and params.yaml is what conf/ composes to."""

import errno
import os
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from omegaconf import OmegaConf

from pedpred import config
from pedpred.errors import ConfigError, ValueRuleError
from stages.config import SHARED_PARTS, write_shared
from tests.configuration import read
from tests.conftest import ROOT
from tests.refused import refused

DVC_YAML = """
vars:
  - places: [eth, hotel]
stages:
  plain: {cmd: x, params: [training.rate, seed]}
  bare: {cmd: x}
  listed:
    foreach: [eth, hotel]
    do: {cmd: x, params: ["scenes.${item}"]}
  keyed:
    foreach: ${models}
    do: {cmd: x, params: ["models.${key}", training]}
  crossed:
    matrix: {network: "${models}", to: "${places}"}
    cmd: x
    params: ["models.${item.network}", "scenes.${item.to}"]
  referring:
    foreach: ${scenes}
    do: {cmd: x, params: ["scenes.${key}", "trackers.${item.tracker}"]}
  sharing: {cmd: x, deps: [conf, data/config/trackers.yaml], params: [seed]}
  missing: {cmd: x, params: [scenes.zara]}
"""
PARAMS_YAML = """
seed: null
training: {rate: 0.1, phases: {first: {steps: 1}, second: {steps: 2}}}
scenes: {eth: {tracker: quick}, hotel: {tracker: slow}}
trackers: {quick: {q: 1}, slow: {q: 2}}
models: {lstm: {units: 4}, lstm_nogrid: {units: 2}}
"""
TRAINING = {"rate": 0.1, "phases": {"first": {"steps": 1}, "second": {"steps": 2}}}
STAGE = """
from pathlib import Path
from pedpred.config import stage


@stage("name")
def main(cfg):
    seen = f"{cfg.get('name', 'nobody')} {cfg.training.rate} {cfg.seed}"
    Path(cfg.get("out") or "seen.txt").write_text(seen)
    if cfg.get("out") == "spill.txt":
        cfg.models.lstm
    if cfg.get("curve"):
        Path(cfg.curve).write_text("step")


if __name__ == "__main__":
    main()
"""


@pytest.fixture
def project(tmp_path):
    """A tiny project: dvc.yaml, params.yaml, conf/ and one stage. It has its own copy of the library."""
    for name, text in {
        "dvc.yaml": DVC_YAML,
        "dvc.lock": "schema: '2.0'\nstages:\n  bare:\n    cm",  # another process writes it
        "params.yaml": PARAMS_YAML,
        "conf/config.yaml": f"defaults: [_self_, scale: default]\n{PARAMS_YAML}",
        "conf/scale/default.yaml": "pedestrians: 20\n",
        "conf/scale/smoke.yaml": "pedestrians: 2\n",
        "stages/__init__.py": "",  # as in the project, so that its own stages come first
        "stages/look.py": STAGE,
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "pedpred").mkdir()
    for name in ["__init__.py", "config.py", "errors.py", "files.py", "lazy.py", "plain.py"]:
        shutil.copy(ROOT / "pedpred" / name, tmp_path / "pedpred" / name)
    return tmp_path


# What a stage sees


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        ("plain", {"training": {"rate": 0.1}, "seed": None}),
        ("bare", {}),
        ("listed@hotel", {"scenes": {"hotel": {"tracker": "slow"}}}),
        ("keyed@lstm_nogrid", {"models": {"lstm_nogrid": {"units": 2}}, "training": TRAINING}),
        ("referring@eth", {"scenes": {"eth": {"tracker": "quick"}}, "trackers": {"quick": {"q": 1}}}),
        ("crossed@lstm-hotel", {"models": {"lstm": {"units": 4}}, "scenes": {"hotel": {"tracker": "slow"}}}),
    ],
)
def test_stage_sees_its_declared_keys_and_nothing_else(project, address, expected):
    arguments = {"name": "eth", "out": "a"}
    assert config.declared(project, address, []) == expected
    assert config.declared(project, address, ["+name=eth", "--flag", "out=a"]) == expected | arguments


def test_stage_sees_shared_parts_as_they_were_checked(project):
    with refused("trackers"):
        config.declared(project, "sharing", [])
    params = OmegaConf.create({name: {"slow": {"q": 1e-7}} for name in SHARED_PARTS})
    write_shared(params, project)
    assert config.declared(project, "sharing", []) == {"seed": None, "trackers": {"slow": {"q": 1e-7}}}


def test_unknown_stage_or_declared_key_is_refused(project):
    with refused("scenes.zara"):
        config.declared(project, "missing", [])
    for address in ("nothing", "listed@zara", "listed", "plain@eth"):
        with refused("DVC_STAGE"):
            config.declared(project, address, [])


def test_row_is_merged_over_its_base():
    cfg = OmegaConf.create({"forces": {"a": {"x": {"p": 1, "q": 2}}, "b": {"base": "a", "x": {"q": 3}}}})
    assert config.row(cfg, "forces", "b") == {"x": {"p": 1, "q": 3}}
    assert config.row(cfg, "forces", "a") == {"x": {"p": 1, "q": 2}}
    with refused("forces"):
        config.row(cfg, "forces", "c")
    cfg = OmegaConf.create({"forces": {"a": {"base": "b"}, "b": {"base": "a"}}})
    with refused("forces.a.base"):
        config.row(cfg, "forces", "a")


def test_errors_of_settings_get_the_configuration_key():
    for error, key in (
        (ValueRuleError("every", 0, "it must be positive"), "sensors.robot.every"),
        (TypeError("unexpected keyword argument 'magic'"), "sensors.robot"),
    ):
        with pytest.raises(ConfigError) as raised, config.configured("sensors.robot"):
            raise error
        assert raised.value.field == key


# How a stage ends


@pytest.fixture
def look(project, monkeypatch, capfd):
    """Runs the stage of the tiny project in this process, where that ends it early; what it says."""
    monkeypatch.chdir(project)
    monkeypatch.delenv("DVC_STAGE", raising=False)

    def run(*arguments, **environment):
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        monkeypatch.setattr(sys, "argv", ["look", *arguments])
        with pytest.raises(SystemExit) as ended:
            runpy.run_path("stages/look.py", run_name="__main__")
        assert ended.value.code not in (None, 0)
        return f"{capfd.readouterr().err}{ended.value}"

    return run


def run_stage(project, *arguments, **environment):
    """Run the stage of the tiny project in a process of its own; names of files that were not there."""
    before = {path.name for path in project.iterdir()}
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("DVC_")}
    command = [sys.executable, "-m", "stages.look", *arguments]
    done = subprocess.run(command, cwd=project, env=inherited | environment, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    return {path.name for path in project.iterdir()} - before - {"build"}


def test_stage_under_dvc_writes_its_output_and_nothing_else(project):
    assert run_stage(project, DVC_STAGE="plain") == {"seen.txt"}
    assert (project / "seen.txt").read_text() == "nobody 0.1 None"


def test_stage_by_hand_composes_conf_with_overrides(project):
    look = project / "stages/look.py"
    look.write_text(look.read_text().replace('@stage("name")', '@stage("name", "curve")'))
    made = run_stage(project, "training.rate=0.5", "+out=mine.txt", "+name=eth", "hydra.run.dir=.")
    assert made >= {"mine.txt", "mine.txt.tsv"}
    assert (project / "mine.txt").read_text() == "eth 0.5 None"
    assert (project / "mine.txt.tsv").read_text() == "step", "the curve of a trial, beside it"


def test_runs_of_several_values_leave_their_outputs_alone(project):
    with (project / "conf" / "config.yaml").open("a") as file:
        file.write(yaml.safe_dump({"hydra": read("conf/config.yaml")["hydra"]}))
    made = run_stage(project, "--multirun", "training.rate=1,2", "+out=${training.rate}.txt")
    assert made == {"1.txt", "2.txt"}


def test_undeclared_key_ends_the_stage_with_its_name(look):
    said = look("+out=spill.txt", DVC_STAGE="plain")
    assert "'models'" in said
    assert "stage 'plain'" in said


def test_stage_refuses_a_bad_output_before_it_works(look):
    assert look("+out=/dev/full", DVC_STAGE="plain").startswith("OutputError")


@pytest.mark.parametrize("added", ["+Out=1", "++trainings.rate=1"])
def test_argument_that_nobody_reads_is_refused(project, look, added):
    """A misspelt argument, and a key that conf/ does not have."""
    said = look("+name=eth", added)
    assert f"'{added.lstrip('+').partition('=')[0]}' = '1'" in said
    assert not (project / "seen.txt").exists()


def test_a_missing_file_of_the_pipeline_has_a_remedy():
    for name, is_made in (("data/none", True), ("none", False)):
        with pytest.raises(SystemExit) as ended, config.config_errors():
            raise FileNotFoundError(errno.ENOENT, "missing", name)
        assert ("dvc repro" in str(ended.value)) is is_made


# params.yaml


@pytest.fixture
def compose(project, monkeypatch):
    """Runs `python -m pedpred.config` in the tiny project; what it says where it fails."""
    monkeypatch.chdir(project)
    monkeypatch.delenv("DVC_EXP_NAME", raising=False)

    def run(*arguments):
        try:
            config.main(list(arguments))
        except SystemExit as ended:
            return str(ended)
        return ""

    return run


def test_unknown_key_or_option_is_refused_by_name(project, compose):
    for override, name in (("training.pace=0.5", "pace"), ("scale=huge", "huge")):
        assert name in compose(override)
    assert (project / "params.yaml").read_text() == PARAMS_YAML


def test_composed_params_pass_the_check(compose):
    assert compose() == ""
    first = Path("params.yaml").read_bytes()
    assert compose() == ""
    assert Path("params.yaml").read_bytes() == first
    assert compose("--check", "--stamp", "data/checked") == ""
    assert Path("data/checked").is_file()


def test_check_fails_with_a_diff_after_an_edit_under_conf(project, compose):
    compose()
    (project / "conf" / "scale" / "default.yaml").write_text("pedestrians: 21\n")
    said = compose("--check", "--stamp", "data/checked")
    assert "-  pedestrians: 20\n+  pedestrians: 21" in said
    assert "make params" in said
    assert not (project / "data" / "checked").exists()


def test_params_of_an_experiment_pass_the_check_in_it(compose, monkeypatch):
    compose("scale=smoke")
    assert compose("--check") != ""
    monkeypatch.setenv("DVC_EXP_NAME", "sweep-1")
    assert compose("--check") == ""
