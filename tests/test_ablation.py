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
        written |= {next(iter(entry)).replace("${key}", key) for entry in PIPELINE[name]["do"]["outs"]}
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


def test_the_time_to_an_error_is_that_of_the_first_validation_below_it():
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


def test_an_ablation_that_does_not_exist_is_named_beside_those_that_do():
    known = r"\['layouts', 'mixture', 'mixture_modes', 'pretraining', 'reach', 'seeds'\]"
    with pytest.raises(ValueRuleError, match=f"ablation = 'magic', but known ablations are {known}"):
        read_ablation(ABLATIONS[0].with_stem("magic"))


@pytest.mark.parametrize(
    ("line", "said"),
    [("titel: x", "titel = 'x', but there is no such field"), ("columns: {a: {b: 1}}", "columns.a.b = 1")],
)
def test_an_unknown_key_of_an_ablation_is_named(tmp_path, line, said):
    (file := tmp_path / "reach.yaml").write_text(f"{ABLATIONS[0].read_text()}\n{line}\n")
    with pytest.raises(InputError, match=re.escape(said)):
        read_ablation(file)


def test_a_point_that_does_not_exist_is_named_beside_those_that_do(monkeypatch):
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr("sys.argv", ["ablate", "reach", "--point", "0.3"])
    with pytest.raises(SystemExit, match=r"choose one of 0\.05, 0\.1, 0\.15, 0\.2"):
        ablate.main()


def test_a_point_without_overrides_is_in_order():
    ablation = read_ablation(ABLATIONS[0].with_stem("reach"))
    ablate.check_points(dataclasses.replace(ablation, points={"1": []}), ROOT / "conf")


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"methods": ["lstmm"]}, "key 'methods' = 'lstmm': choose some of .*lstm, "),
        ({"references": ["kalman"]}, "key 'references' = 'kalman': choose some of .*kalman_cv, "),
        ({"points": {"1": [], "2": ["training.main.stepz=5"]}}, "training.main.stepz"),
        ({"points": {"2": ["training.main.steps=-5"]}}, "training.main.steps"),
        ({"points": {"wide": []}}, "key 'points' = 'wide': with an axis, .* a positive number"),
        ({"points": {}}, "key 'points' = None: name one at least"),
        ({"methods": []}, "key 'methods' = None: name one at least"),
        ({"targets": ["gathr@sim"]}, "key 'targets' = 'gathr': choose one of .*gather, "),
        ({"targets": ["gather@real"]}, "key 'metrics' = 'reports/metrics/sim.json': no target writes"),
        ({"metrics": "reports/metrics/simulation.json"}, "key 'metrics' = .*no target writes this file"),
        ({"entry": "sim_tset"}, "key 'entry' = 'sim_tset': study sim tests sim_test"),
        ({"columns": {"a": Column(SIM, "sim_tset")}}, "key 'columns' = 'sim_tset': study sim tests sim_test"),
        (
            {"columns": {"a": Column(SIM, "sim_test", "fde")}},
            "key 'columns' = 'fde': choose one of .*fde_m, ",
        ),
        ({"columns": {"a": Column(SIM, "sim_test", over="kf")}}, "key 'columns' = 'kf': choose some of "),
        ({"columns": {"a": Column("reports/metrics/real.json", "eth")}}, "key 'metrics' = .*/real.json"),
        ({"curves": {"lstmm": "reports/curves/sim/main_lstm.tsv"}}, "key 'curves' = 'lstmm': choose some"),
        ({"curves": {"lstm": "reports/curve/main_lstm.tsv"}}, "key 'curves' = .*: no stage writes this file"),
        (
            {"always": ["methods.networks.lstm.where=[real]"]},
            "'methods.lstm.where' = .*sim_test is simulated",
        ),
    ],
)
def test_what_an_ablation_cannot_show_is_found_before_any_point_runs(changes, named):
    """Figures are looked up when all points have been trained, for hours."""
    ablation = read_ablation(ABLATIONS[0].with_stem("reach"))
    with pytest.raises((ConfigError, ValueRuleError), match=named):
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


def test_a_single_room_of_a_test_set_can_be_shown():
    ablation = read_ablation(ABLATIONS[0].with_stem("reach"))
    of_room = dataclasses.replace(ablation, points={"1": []}, entry="sim_test_office")
    ablate.check_points(of_room, ROOT / "conf")


@pytest.mark.parametrize(
    ("there", "said"),
    [({}, "'entry' = 'sim_test': choose one of "), ({"sim_test": {"lstm": {}}}, "'methods' = 'kalman_cv': ")],
)
def test_a_figure_that_no_run_measured_is_named(there, said):
    ablation = read_ablation(ABLATIONS[0].with_stem("reach"))
    with pytest.raises(ConfigError, match=said):
        ablate.check_measured(ablation, {"0.1": {ablation.metrics: there}})


def test_a_misspelt_key_is_refused(tmp_path):
    path = tmp_path / "odd.yaml"
    path.write_text(ABLATIONS[0].read_text().replace("entry:", "entyr:"))
    with pytest.raises(InputError, match=r"odd\.yaml.*entyr"):
        read_ablation(path)


def test_programs_are_found_where_nobody_activated_the_environment(monkeypatch):
    there = Path(sys.executable).parent
    monkeypatch.setenv("PATH", os.pathsep.join(["/usr/bin", "/bin"]))
    assert "usage" in ablate.said_by("dvc", "--help").lower()
    shown = ablate.said_by("python", "-c", "import sys; print(sys.executable)")
    assert Path(shown.strip()).parent == there
    assert ablate.said_by("git", "--version")


@pytest.mark.filterwarnings("ignore:_NoneStep.value:DeprecationWarning")  # of DVC
def test_what_waits_in_the_queue_under_the_name_of_a_point_is_not_run(tmp_path, monkeypatch):
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
