"""Ablations: what they ask for exists, and their points become a picture and a table."""

import dataclasses
from itertools import combinations
from pathlib import Path

import pandas as pd
import pytest

from pedpred.errors import ConfigError, ValueRuleError
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
