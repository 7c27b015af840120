"""`python -m tools.judge`: which figures hold, and what it prints."""

import json
import shutil
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pedpred.config import read_params
from pedpred.errors import ValueRuleError
from pedpred.online.network import read_origin
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
    room_verdicts,
)

OWN = {"ade_m": 0.3, "ade_m_ci95": [0.28, 0.32], "ade_m_minus_reference_ci95": [-0.12, -0.08]}
OWN |= {"standing_ade_m": 0.1, "nll": -1.0, "per_step_m": [0.1] * 10}
OWN |= {"per_step_coverage_50": [0.5] * 10, "per_step_coverage_90": [0.9] * 10}
OWN |= {"per_step_coverage_95": [0.95] * 10}
SIMPLE = {"cv": {"ade_m": 0.5, "standing_ade_m": 0.3}, "kalman_cv": {"ade_m": 0.4, "standing_ade_m": 0.2}}
SIMPLE["kalman_cv"]["nll"] = 0.0
GOOD, BAD = at_most("eth", "ADE", 1.0, 2.0), at_most("eth", "ADE", 3.0, 2.0)
PARAMS = cache(read_params)


@pytest.fixture(autouse=True)
def read_once(monkeypatch):
    """params.yaml is read once: that takes longer than what is tested."""
    monkeypatch.setattr(judge, "read_params", PARAMS)


def verdicts(**changes):
    own = OWN | changes
    found = place_verdicts("eth", SIMPLE | {"network": own}, "network", PromiseRow("kalman_cv", 0.97))
    return {verdict.what: verdict for verdict in (*found, *region_verdicts("eth", own))}


def test_a_good_network_holds_everything():
    assert all(verdict.holds for verdict in verdicts().values())


@pytest.mark.parametrize(
    ("changes", "broken"),
    [
        ({"ade_m": 0.395}, {"ADE / kalman_cv"}),
        ({"ade_m": 0.41}, {"ADE / better simple method", "ADE / kalman_cv"}),
        ({"ade_m_minus_reference_ci95": [-0.1, 0.02]}, {"end of its interval"}),
        ({"standing_ade_m": 0.21}, {"the same, standing people"}),
        ({"nll": 0.1}, {"NLL (limit: kalman_cv)"}),
        ({"per_step_coverage_90": [0.9] * 9 + [0.8]}, {"% in regions after step 10"}),
        ({"ade_m": float("nan")}, {"ADE / better simple method", "ADE / kalman_cv"}),
    ],
)
def test_what_is_broken_is_named(changes, broken):
    assert {what for what, verdict in verdicts(**changes).items() if not verdict.holds} == broken


def test_a_missing_figure_breaks_the_promise():
    assert not any(verdict.holds for verdict in room_verdicts("rooms", {}, {"ade_m": 0.4}))


def test_regions_at_three_horizons():
    assert [v.what for v in region_verdicts("eth", OWN)] == [
        f"% in regions after step {k}" for k in (1, 5, 10)
    ]


def test_a_model_is_worse_in_regions_if_it_breaks_more_of_them():
    def model(*broken):
        return [Verdict("eth", f"region {k}", "", "", k not in broken, counted=True) for k in range(4)]

    assert newly_broken(model(1), model(2)) == []
    assert newly_broken(model(1, 2), model(2)) == [model(1, 2)[1]]
    assert newly_broken(model(), model(0, 1, 2, 3)) == []
    assert newly_broken(model(1), [*model(), BAD]) == []
    assert newly_broken([*model(1), BAD], model(2)) == [model(1)[1], BAD]


@pytest.mark.parametrize(("low", "holds"), [(-0.1, True), (0.9 * SEEDS, True), (1.1 * SEEDS, False)])
def test_an_error_is_larger_if_seeds_do_not_explain_it(low, holds):
    other = 0.5
    verdict = no_worse("eth", other * (1 + low) + 0.01, other, [other * low, other * low + 0.02])
    assert verdict.holds == holds


def test_the_summary_repeats_what_is_broken(capsys):
    good, bad = at_most("eth", "ADE", 1.0, 2.0), at_most("hotel", "ADE", 3.0, 2.0)
    assert judge.print_verdicts(iter([good, bad])) == [good, bad]
    output = capsys.readouterr().out
    assert (output.count(judge.line(good)), output.count(judge.line(bad))) == (1, 2)
    assert "1 of 2 promises" in output


def test_a_folder_is_taken_from_a_revision_however_it_is_named(tmp_path, monkeypatch, model):
    monkeypatch.chdir(tmp_path)
    folder, scratch = Path("models/online/default"), tmp_path / "scratch"
    shutil.copytree(model[0], folder)
    git(tmp_path, "init -q", "add models", "commit -qm model")
    assert judge.folder_at(str(folder), folder, scratch) == folder
    for named in (folder, folder.resolve(), Path("..") / tmp_path.name / folder):
        kept = judge.folder_at("HEAD", named, scratch)
        assert kept.parent == scratch
        assert read_origin(kept) == read_origin(model[0])
    later = Path("models/online/later")
    later.mkdir()
    assert judge.folder_at("HEAD", later, scratch) is None
    with pytest.raises(ValueRuleError):
        judge.folder_at("HEAD~0", later, scratch)


def test_nothing_is_compared_where_nothing_is_committed(tmp_path):
    for command in ("status", "init -q"):
        subprocess.run(["git", *command.split()], cwd=tmp_path, check=False, capture_output=True)
        assert judge.folder_at("HEAD", tmp_path, tmp_path / "scratch") is None


@pytest.mark.parametrize("history", [True, False])
@pytest.mark.parametrize("wrong", ["no-such-revision", "no/such/folder", "", "--all", "HEAD..HEAD"])
def test_neither_a_folder_nor_a_revision_is_an_error(tmp_path, wrong, history):
    if history:
        git(tmp_path, "init -q", "commit -q --allow-empty -m empty")
    with pytest.raises(ValueRuleError):
        judge.folder_at(wrong, tmp_path, tmp_path / "scratch")


@pytest.mark.parametrize("option", ["--against", "--replace"])
def test_a_folder_without_a_model_is_refused_before_measuring(tmp_path, monkeypatch, capsys, model, option):
    monkeypatch.chdir(ROOT)
    with pytest.raises(SystemExit, match=str(tmp_path)):
        judge.main([str(model[0]), option, str(tmp_path)])
    assert not capsys.readouterr().out


@pytest.mark.parametrize("judged", [True, False])
def test_files_of_two_models_are_refused_before_measuring(
    judged, tmp_path, monkeypatch, capsys, model, mixture
):
    monkeypatch.chdir(ROOT)
    cut = tmp_path / "cut"
    shutil.copytree(model[0], cut)
    shutil.copy(mixture[0] / "network.onnx", cut)
    with pytest.raises(SystemExit, match=f"git restore {cut}"):
        judge.main([str(cut)] if judged else [str(model[0]), "--replace", str(cut)])
    assert not capsys.readouterr().out


def test_it_fails_and_writes_what_it_found(tmp_path, monkeypatch, capsys, model):
    monkeypatch.chdir(ROOT)
    found = [at_most("eth", "ADE", 3.0, 2.0)]
    monkeypatch.setattr(judge.Judgement, "verdicts", lambda self, against: iter(found))
    (tmp_path / "model").symlink_to(model[0])
    with pytest.raises(SystemExit, match="1"):
        judge.main([str(tmp_path / "model"), "--out", str(tmp_path / "out.json")])
    assert "FAIL" in capsys.readouterr().out
    kept = json.loads((tmp_path / "out.json").read_text())["verdicts"]
    assert [Verdict(**verdict) for verdict in kept] == found
    assert np.isfinite(float(found[0].found))


BETTER, WORSE = (no_worse("eth", 1.0 + low, 1.0, [low, low + 0.1]) for low in (-0.2, 0.2))


@pytest.mark.parametrize(
    ("candidate", "present", "worse"),
    [
        ([GOOD, BETTER], [GOOD], []),
        ([BAD, BETTER], [BAD], []),
        ([BAD, BETTER], [GOOD], [BAD]),
        ([GOOD, WORSE], [GOOD], [WORSE]),
        ([BAD, WORSE], [BAD], [WORSE]),
        ([BAD], None, []),
    ],
    ids=["better", "both break it", "breaks it", "larger error", "both", "first"],
)
def test_a_model_replaces_the_default_unless_it_is_worse(
    candidate, present, worse, tmp_path, monkeypatch, capsys, model, mixture
):
    monkeypatch.chdir(ROOT)
    new, default = mixture[0], tmp_path / "default"
    if present is not None:
        shutil.copytree(model[0], default)
    found = {(new, None if present is None else default): candidate, (default, None): present}
    monkeypatch.setattr(judge.Judgement, "verdicts", lambda self, against: iter(found[self.folder, against]))
    with pytest.raises(SystemExit, match=str(int(bool(worse)))):
        judge.main([str(new), "--replace", str(default)])
    assert contents(default) == contents(model[0] if worse else new)
    refusal = capsys.readouterr().out.partition(f"{default} stays as it is")[2]
    assert refusal.partition("\n")[2] == "".join(map(judge.line, worse))


@pytest.mark.parametrize(("accepted", "refused"), [("eth", False), ("hotel", True)])
def test_what_is_accepted_may_get_worse_and_nothing_else(
    accepted, refused, tmp_path, monkeypatch, capsys, model, mixture
):
    monkeypatch.chdir(ROOT)
    new, default = mixture[0], tmp_path / "default"
    shutil.copytree(model[0], default)
    found = {(new, default): [GOOD, WORSE], (default, None): [GOOD]}
    monkeypatch.setattr(judge.Judgement, "verdicts", lambda self, against: iter(found[self.folder, against]))
    with pytest.raises(SystemExit, match=str(int(refused))):
        judge.main([str(new), "--replace", str(default), "--accept", accepted])
    assert contents(default) == contents(model[0] if refused else new)
    assert (f"accepted: {judge.line(WORSE)}" in capsys.readouterr().out) == (not refused)


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_model_is_judged_by_the_latest_run_that_exports_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder, metrics, lock = Path("models/default"), Path("reports/metrics/real.json"), Path("dvc.lock")

    def run(number, exported):
        metrics.write_text(f'{{"run": {number}}}')
        outs = f"[{{path: models/online/large, md5: {exported}}}]"
        lock.write_text(f"stages:\n  page: {{}}\n  export@large: {{outs: {outs}}}\n")

    for path in (folder, metrics.parent):
        path.mkdir(parents=True)
    git(tmp_path, "init -q")
    (folder / "model.json").write_text("{}")
    run(1, "a")
    git(tmp_path, "add .", "commit -qm model")
    run(2, "b")
    assert metrics_of(folder) == {"real": {"run": 1}}
    assert metrics_of(Path("models/other")) == {"real": {"run": 2}}
    run(3, "a")
    assert metrics_of(folder) == {"real": {"run": 3}}
    git(tmp_path, "add .", "commit -qm evaluation")
    run(4, "b")
    git(tmp_path, "add .", "commit -qm refused")
    assert metrics_of(folder) == {"real": {"run": 3}}
    (folder / "model.json").write_text('{"other": 1}')
    assert metrics_of(folder) == {"real": {"run": 4}}
