"""`python -m tools.judge`: which figures hold, and which model replaces the default."""

import shutil
from functools import cache
from pathlib import Path

import pytest

from pedpred.config import read_params
from stages.row_types import PromiseRow
from tests.conftest import ROOT
from tests.plain_git import git
from tools import judge
from tools.judgement import metrics_of
from tools.verdicts import (
    SEEDS,
    Verdict,
    at_most,
    newly_broken,
    no_worse,
    place_verdicts,
    region_verdicts,
)

OWN = {"ade_m": 0.3, "ade_m_ci95": [0.28, 0.32], "ade_m_minus_reference_ci95": [-0.12, -0.08]}
OWN |= {"standing_ade_m": 0.1, "nll": -1.0, "per_step_m": [0.1] * 10}
OWN |= {f"per_step_coverage_{share}": [share / 100] * 10 for share in (50, 90, 95)}
SIMPLE = {"cv": {"ade_m": 0.5, "standing_ade_m": 0.3}}
SIMPLE["kalman_cv"] = {"ade_m": 0.4, "standing_ade_m": 0.2, "nll": 0.0}
GOOD, BAD = at_most("eth", "ADE", 1.0, 2.0), at_most("eth", "ADE", 3.0, 2.0)
BETTER, WORSE = (no_worse("eth", 1.0 + low, 1.0, [low, low + 0.1]) for low in (-0.2, 0.2))
PARAMS = cache(read_params)  # that takes longer than what is tested


@pytest.mark.parametrize(
    ("changes", "broken"),
    [
        ({}, set()),
        ({"ade_m": 0.395}, {"ADE / kalman_cv"}),
        ({"ade_m": 0.41}, {"ADE / better simple method", "ADE / kalman_cv"}),
        ({"ade_m_minus_reference_ci95": [-0.1, 0.02]}, {"end of its interval"}),
        ({"standing_ade_m": 0.21}, {"the same, standing people"}),
        ({"nll": 0.1}, {"NLL (limit: kalman_cv)"}),
        ({"per_step_coverage_90": [0.9] * 9 + [0.8]}, {"% in regions after step 10"}),
    ],
)
def test_broken_promises_are_named(changes, broken):
    own = OWN | changes
    found = place_verdicts("eth", SIMPLE | {"network": own}, "network", PromiseRow("kalman_cv", 0.97))
    verdicts = (*found, *region_verdicts("eth", own))
    assert {verdict.what for verdict in verdicts if not verdict.holds} == broken


def test_regions_are_worse_if_more_of_them_are_broken():
    def model(*broken):
        return [Verdict("eth", f"region {k}", "", "", k not in broken, counted=True) for k in range(4)]

    assert newly_broken(model(1), model(2)) == []
    assert newly_broken([*model(1, 2), BAD], model(2)) == [model(1, 2)[1], BAD]


def test_error_is_larger_if_seeds_do_not_explain_it():
    for low, holds in ((-0.1, True), (0.9 * SEEDS, True), (1.1 * SEEDS, False)):
        verdict = no_worse("eth", 0.5 * (1 + low) + 0.01, 0.5, [0.5 * low, 0.5 * low + 0.02])
        assert verdict.holds == holds


@pytest.mark.parametrize(
    ("candidate", "present", "accepted", "worse"),
    [
        ([BAD, BETTER], [BAD], "", []),
        ([BAD, BETTER], [GOOD], "", [BAD]),
        ([GOOD, WORSE], [GOOD], "", [WORSE]),
        ([BAD], None, "", []),
        ([GOOD, WORSE], [GOOD], "eth", []),
    ],
    ids=["better", "breaks it", "larger error", "first", "accepted"],
)
def test_a_model_replaces_the_default_unless_it_is_worse(
    candidate, present, accepted, worse, tmp_path, monkeypatch, model, mixture
):
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(judge, "read_params", PARAMS)
    new, default = mixture[0], tmp_path / "default"
    if present is not None:
        shutil.copytree(model[0], default)
    found = {(new, None if present is None else default): candidate, (default, None): present}
    monkeypatch.setattr(judge.Judgement, "verdicts", lambda self, against: iter(found[self.folder, against]))
    with pytest.raises(SystemExit) as ended:
        judge.main([str(new), "--replace", str(default), *(["--accept", accepted] if accepted else [])])
    assert int(str(ended.value)) == bool(worse)
    assert contents(default) == contents(model[0] if worse else new)


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_model_is_judged_by_the_latest_run_that_exports_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder, metrics = Path("models/default"), Path("reports/metrics/real.json")

    def run(number, exported):
        metrics.write_text(f'{{"run": {number}}}')
        outs = f"[{{path: models/online/large, md5: {exported}}}]"
        Path("dvc.lock").write_text(f"stages:\n  page: {{}}\n  export@large: {{outs: {outs}}}\n")

    for path in (folder, metrics.parent):
        path.mkdir(parents=True)
    (folder / "model.json").write_text("{}")
    run(1, "a")
    git(tmp_path, "init -q", "add .", "commit -qm model")
    run(2, "b")
    assert metrics_of(folder) == {"real": {"run": 1}}
    assert metrics_of(Path("models/other")) == {"real": {"run": 2}}
    run(3, "a")
    git(tmp_path, "add .", "commit -qm evaluation")
    run(4, "b")
    git(tmp_path, "add .", "commit -qm refused")
    assert metrics_of(folder) == {"real": {"run": 3}}
    (folder / "model.json").write_text('{"other": 1}')
    assert metrics_of(folder) == {"real": {"run": 4}}
