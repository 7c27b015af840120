"""Ablations: what they ask for exists, and their points become a picture and a table."""

import dataclasses
import os
import re
import subprocess
import sys
from itertools import combinations
from pathlib import Path

import pandas as pd
import pytest
import yaml
from dvc.repo import Repo

from pedpred import config
from pedpred.errors import ConfigError, InputError, ValueRuleError
from pedpred.plain import parse_yaml
from pedpred.report.ablation import (
    Column,
    ablation_figure,
    ablation_table,
    point_rows,
    read_ablation,
    steps_table,
    steps_until,
)
from pedpred.report.canvas import png_bytes
from stages.config import check_parts
from tests.configuration import composed, read
from tests.forecasts import METHODS
from tools import ablate

ROOT = Path(__file__).parents[1]
ABLATIONS = sorted((ROOT / "conf" / "ablations").glob("*.yaml"))
PIPELINE = read("dvc.yaml")["stages"]
SIM = "reports/metrics/sim.json"


def composed_points(ablation):
    return [composed(*ablation.always, *overrides) for overrides in ablation.points.values()]


def test_points_are_what_conf_composes_to():
    ablation = read_ablation(ROOT / "conf" / "ablations" / "pretraining.yaml")
    _, second, *_ = composed_points(ablation)
    overrides = [*ablation.always, *list(ablation.points.values())[1]]
    assert second == parse_yaml(config.composed(ROOT / "conf", overrides))


@pytest.mark.parametrize("path", ABLATIONS, ids=lambda path: path.stem)
def test_every_point_composes_and_differs(path):
    ablation = read_ablation(path)
    points = composed_points(ablation)
    assert all(one != other for one, other in combinations(points, 2))
    for point in points:
        check_parts(point)  # else the stage `config` ends the experiment
    written = set()
    for name, _, key in (target.partition("@") for target in ablation.targets):
        outs = PIPELINE[name]["do"]["outs"]
        written |= {next(iter(entry)).replace("${key}", key) for entry in outs}
    assert {ablation.metrics, *(column.metrics for column in ablation.columns.values())} <= written
    assert f"simulated/{ablation.entry}" in points[0]["folds"]["sim"]["simulation"]["test"]


def measured(ablation):
    methods = ("kalman_cv", "lstm_nogrid", "lstm")
    figures = ({"ade_m": 0.5 - 0.01 * k, "ade_m_ci95": [0.4, 0.6]} for k in range(len(ablation.points)))
    points = zip(ablation.points, figures, strict=True)
    return {p: {ablation.metrics: {ablation.entry: dict.fromkeys(methods, own)}} for p, own in points}


@pytest.mark.parametrize("path", [ABLATIONS[0], ABLATIONS[3]], ids=["numbered", "named"])
def test_points_become_a_picture_and_a_table(path):
    ablation = read_ablation(path)
    rows = point_rows(ablation, measured(ablation))
    assert len(rows) == len(ablation.points) * 3
    assert rows[0]["overrides"] == [*ablation.always, *ablation.points[rows[0]["point"]]]
    assert png_bytes(ablation_figure(ablation, rows, METHODS)).startswith(b"\x89PNG")
    lines = ablation_table(ablation, rows, METHODS).splitlines()
    assert len(lines) == 2 + len(ablation.points)
    assert "0.500 (0.400 to 0.600)" in lines[2]


def test_repeated_points_have_a_mean_and_a_spread():
    ablation = read_ablation(ROOT / "conf" / "ablations" / "seeds.yaml")
    assert len(ablation.points) == 3
    rows = point_rows(ablation, measured(ablation))
    last = ablation_table(ablation, rows, METHODS).splitlines()[-1]
    assert last.count("0.490 ± 0.010") == 3  # of 0.50, 0.49 and 0.48


def test_a_single_point_has_no_spread():
    plain = read_ablation(ROOT / "conf" / "ablations" / "seeds.yaml")
    ablation = dataclasses.replace(plain, points={"second": plain.points["second"]})
    rows = point_rows(ablation, measured(ablation))
    assert ablation_table(ablation, rows, METHODS).splitlines()[2:] == [
        "| second | 0.500 (0.400 to 0.600) | 0.500 (0.400 to 0.600) | 0.500 (0.400 to 0.600) |"
    ]


def test_columns_are_further_figures_of_the_last_method():
    plain = read_ablation(ROOT / "conf" / "ablations" / "seeds.yaml")
    columns = {
        "of all, m": Column(plain.metrics, plain.entry),
        "ratio at eth": Column("transfer.json", "eth", over="kalman_cv"),
        "minADE": Column("transfer.json", "eth", "min_ade_m_k6"),
    }
    ablation = dataclasses.replace(plain, columns=columns)
    files = measured(ablation)
    for k, own in enumerate(files.values()):
        own["transfer.json"] = {
            "eth": {"kalman_cv": {"ade_m": 0.4}, "lstm": {"ade_m": 0.3, "min_ade_m_k6": k}}
        }
    rows = point_rows(ablation, files)
    assert [row["columns"] for row in rows if "columns" in row][1] == {
        "of all, m": 0.49,
        "ratio at eth": pytest.approx(0.75),
        "minADE": 1.0,
    }
    lines = ablation_table(ablation, rows, METHODS).splitlines()
    assert lines[7] == "| LSTM | of all, m | ratio at eth | minADE |"
    assert lines[9] == "| first | 0.500 | 0.750 | 0.000 |"
    assert lines[12] == "| mean ± standard deviation | 0.490 ± 0.010 | 0.750 ± 0.000 | 1.000 ± 1.000 |"


@pytest.mark.parametrize(
    "measured_there", [{}, {"eth": {}}, {"eth": {"lstm": {"ade_m": 0.3}}}, {"eth": {"lstm": {"fde_m": 0.6}}}]
)
def test_a_figure_that_was_not_measured_is_left_open(measured_there):
    plain = read_ablation(ROOT / "conf" / "ablations" / "seeds.yaml")
    column = Column("transfer.json", "eth", over="kalman_cv")
    ablation = dataclasses.replace(plain, columns={"ratio at eth": column})
    files = measured(ablation)
    for own in files.values():
        own["transfer.json"] = measured_there
    lines = ablation_table(ablation, point_rows(ablation, files), METHODS).splitlines()
    assert [line.split(" | ")[1] for line in lines[9:]] == ["- |"] * 4


def test_steps_to_an_error_end_at_the_first_validation_below():
    ablation = read_ablation(ROOT / "conf" / "ablations" / "pretraining.yaml")
    step = [0, 100, 200, 300]
    slow = pd.DataFrame({"step": step, "validation_ade_m": [0.9, 0.8, 0.575, 0.55]})
    fast = pd.DataFrame({"step": step, "validation_ade_m": [0.7, 0.54, 0.5, 0.52]})
    curves = {point: {"lstm_nogrid": slow, "lstm": slow} for point in ablation.points}
    curves["both"] = {"lstm_nogrid": fast, "lstm": fast}
    found = steps_until(ablation, curves)
    levels_m = list(found["lstm"])
    assert levels_m == pytest.approx([0.6, 0.55, 0.525])
    by_point = [(found["lstm"][m]["both"], found["lstm"][m]["no corridor"]) for m in levels_m]
    assert by_point[0] == (100, 200)
    assert by_point[2] == (200, None)
    lines = steps_table(ablation, found, METHODS).splitlines()
    assert len(lines) == 2 + len(ablation.points)
    assert "LSTM to 0.525 m" in lines[0]
    assert lines[3].count("never") == 2


def test_an_unknown_ablation_is_an_error_with_the_known_ones():
    with pytest.raises(ValueRuleError) as error:
        read_ablation(ABLATIONS[0].with_stem("magic"))
    assert all(path.stem in str(error.value) for path in ABLATIONS)


@pytest.mark.parametrize(
    ("old", "new"),
    [("title:", "titel:"), ("entry:", "entyr:"), ("references:", "columns: {a: {b: 1}}\nreferences:")],
)
def test_an_unknown_key_of_an_ablation_is_an_error(tmp_path, old, new):
    (file := tmp_path / "reach.yaml").write_text(ABLATIONS[0].read_text().replace(old, new, 1))
    with pytest.raises(InputError):
        read_ablation(file)


def test_an_unknown_point_is_an_error_with_the_known_ones(monkeypatch):
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr("sys.argv", ["ablate", "reach", "--point", "0.3"])
    with pytest.raises(SystemExit) as ended:
        ablate.main()
    assert "0.05, 0.1, 0.15, 0.2" in str(ended.value)


@pytest.mark.parametrize(
    "changes",
    [
        {"methods": ["lstmm"]},
        {"references": ["kalman"]},
        {"curves": {"lstmm": "reports/curves/sim/main_lstm.tsv"}},
        {"points": {"1": [], "2": ["training.main.stepz=5"]}},
        {"points": {"2": ["training.main.steps=-5"]}},
        {"points": {"wide": []}},
        {"points": {"0": []}},
        {"columns": {"a": Column(SIM, "sim_test", "fde")}},
        {"columns": {"a": Column(SIM, "sim_test", over="kf")}},
    ],
    ids=str,
)
def test_an_ablation_is_checked_before_any_point_runs(changes):
    ablation = read_ablation(ABLATIONS[0].with_stem("reach"))
    ablate.check_points(dataclasses.replace(ablation, points={"1": []}), ROOT / "conf")
    with pytest.raises((ConfigError, ValueRuleError)):
        ablate.check_points(dataclasses.replace(ablation, **{"points": {"1": []}} | changes), ROOT / "conf")


@pytest.mark.parametrize("path", ABLATIONS, ids=lambda path: path.stem)
def test_what_the_ablations_here_show_is_in_order(path):
    ablation = read_ablation(path)
    first = dict([next(iter(ablation.points.items()))])
    ablate.check_points(dataclasses.replace(ablation, points=first), ROOT / "conf")


def test_the_ablation_that_the_page_shows_is_in_order(tmp_path):
    page = (ROOT / "docs" / "ablations.md").read_text()
    (path := tmp_path / "memory.yaml").write_text(re.search("```yaml\n(.*?)```", page, re.DOTALL)[1])
    ablate.check_points(read_ablation(path), ROOT / "conf")


@pytest.mark.parametrize("measured_there", [{}, {"sim_test": {"lstm": {}}}])
def test_a_figure_that_no_run_measured_is_an_error(measured_there):
    ablation = read_ablation(ABLATIONS[0].with_stem("reach"))
    with pytest.raises(ConfigError):
        ablate.check_measured(ablation, {"0.1": {ablation.metrics: measured_there}})


def test_programs_are_found_without_an_activated_environment(monkeypatch):
    there = Path(sys.executable).parent
    monkeypatch.setenv("PATH", os.pathsep.join(["/usr/bin", "/bin"]))
    assert "usage" in ablate.output_of("dvc", "--help").lower()
    shown = ablate.output_of("python", "-c", "import sys; print(sys.executable)")
    assert Path(shown.strip()).parent == there
    assert ablate.output_of("git", "--version")


@pytest.mark.filterwarnings("ignore:_NoneStep.value:DeprecationWarning")  # of DVC
def test_queued_experiments_with_names_of_points_are_removed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stages = {"gather": {"cmd": "true", "params": ["x"]}}
    for name, content in (("dvc.yaml", {"stages": stages}), ("params.yaml", {"x": 1})):
        Path(name).write_text(yaml.safe_dump(content))

    def git(*words):
        subprocess.run(["git", *words], check=True)

    git("init", "--quiet")
    for key in ("user.name", "user.email"):
        git("config", key, "somebody")
    Repo.init().close()
    git("add", "--all")
    git("commit", "--quiet", "--message", "first")
    with Repo() as project:
        experiments = project.experiments
        for name in ("reach-0.1", "mine"):
            changes = {"params.yaml": ["x=2"]}
            experiments.queue_one(experiments.celery_queue, targets=["gather"], params=changes, name=name)
        ablate.leave_queue({"reach-0.1"})
        assert [task["name"] for task in experiments.celery_queue.status()] == ["mine"]
