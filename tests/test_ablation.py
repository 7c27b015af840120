"""Ablations: what they ask for exists, and their points become a picture and a table."""

import dataclasses
from itertools import combinations

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
from tests.conftest import ROOT
from tests.forecasts import METHODS
from tools import ablate

CONF = ROOT / "conf"
ABLATIONS = sorted((CONF / "ablations").glob("*.yaml"))


@pytest.mark.slow
@pytest.mark.parametrize("path", ABLATIONS, ids=lambda path: path.stem)
def test_points_compose_differ_and_make_what_is_measured(path):
    ablation, pipeline = read_ablation(path), read("dvc.yaml")["stages"]
    points = [composed(*ablation.always, *overrides) for overrides in ablation.points.values()]
    assert all(one != other for one, other in combinations(points, 2))
    for point in points:
        check_parts(point)  # else the stage `config` ends the experiment
    written = set()
    for name, _, key in (target.partition("@") for target in ablation.targets):
        written |= {next(iter(out)).replace("${key}", key) for out in pipeline[name]["do"]["outs"]}
    assert {ablation.metrics, *(column.metrics for column in ablation.columns.values())} <= written
    assert f"simulated/{ablation.entry}" in points[0]["folds"]["sim"]["simulation"]["test"]


def measured(ablation):
    """An error of 0.50 m at the first point, 0.49 m at the next one, and so on."""
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
    assert png_bytes(ablation_figure(ablation, rows, METHODS))
    lines = ablation_table(ablation, rows, METHODS).splitlines()
    assert len(lines) == 2 + len(ablation.points)
    assert "0.500 (0.400 to 0.600)" in lines[2]


def test_repeated_points_have_a_mean_and_a_spread():
    ablation = read_ablation(CONF / "ablations/seeds.yaml")
    last = ablation_table(ablation, point_rows(ablation, measured(ablation)), METHODS).splitlines()[-1]
    assert last.count("0.490 ± 0.010") == 3  # of 0.50, 0.49 and 0.48


def test_steps_to_an_error_end_at_the_first_validation_below():
    ablation, step = read_ablation(CONF / "ablations/pretraining.yaml"), [0, 100, 200, 300]
    slow = pd.DataFrame({"step": step, "validation_ade_m": [0.9, 0.8, 0.575, 0.55]})
    fast = pd.DataFrame({"step": step, "validation_ade_m": [0.7, 0.54, 0.5, 0.52]})
    curves = {point: {"lstm_nogrid": slow, "lstm": slow} for point in ablation.points}
    curves["both"] = {"lstm_nogrid": fast, "lstm": fast}
    found = steps_until(ablation, curves)["lstm"]
    assert list(found) == pytest.approx([0.6, 0.55, 0.525])
    steps = [(at["both"], at["no corridor"]) for at in found.values()]
    assert (steps[0], steps[2]) == ((100, 200), (200, None))
    lines = steps_table(ablation, steps_until(ablation, curves), METHODS).splitlines()
    assert len(lines) == 2 + len(ablation.points)
    assert lines[3].count("never") == 2


@pytest.mark.parametrize(
    "changes",
    [
        {"methods": ["lstmm"]},
        {"references": ["kalman"]},
        {"curves": {"lstmm": "reports/curves/sim/main_lstm.tsv"}},
        {"points": {"1": [], "2": ["training.main.steps=-5"]}},
        {"points": {"wide": []}},
        {"columns": {"a": Column("reports/metrics/sim.json", "sim_test", "fde")}},
    ],
    ids=str,
)
def test_ablation_is_checked_before_any_point_runs(changes):
    ablation = dataclasses.replace(read_ablation(CONF / "ablations/reach.yaml"), points={"1": []})
    with pytest.raises((ConfigError, ValueRuleError)):
        ablate.check_points(dataclasses.replace(ablation, **changes), CONF)
