"""The regression gate: what moved beyond its interval is listed, and worse figures fail."""

import copy
import json
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.errors import ValueRuleError
from pedpred.metrics import METRICS, Metric
from pedpred.report.results import metrics_now
from tests.plain_git import git
from tools import compare
from tools.compare import changes, changes_table, metrics_at

ENTRY = {
    "ade_m": 0.5,
    "ade_m_ci95": [0.45, 0.55],
    "fde_m": 1.0,
    "fde_m_ci95": [0.9, 1.1],
    "windows": 10,
    "per_step_m": [0.1, 1.0],
}
GAP = {"ade_m_minus_reference": -0.1, "ade_m_minus_reference_ci95": [-0.12, -0.08]}
BEFORE = {"sim": {"hall": {"cv": ENTRY, "lstm": ENTRY | GAP}}, "walking": {"hall": {"states": 5}}}


def verdicts(after, before=BEFORE):
    """Verdicts by place, method and figure."""
    found = changes(before, after)
    return found.set_index(["place", "method", "figure"])["verdict"].to_dict()


def changed(**figures):
    after = copy.deepcopy(BEFORE)
    after["sim"]["hall"]["lstm"] |= figures
    return after


def test_what_did_not_change_is_the_same():
    assert set(verdicts(BEFORE).values()) == {"same"}
    assert len(verdicts(BEFORE)) == 5


@given(st.floats(0.1, 0.9))
def test_a_figure_is_judged_by_its_earlier_interval(ade_m):
    expected = "worse" if ade_m > 0.55 else "better" if ade_m < 0.45 else "within" if ade_m != 0.5 else "same"
    found = verdicts(changed(ade_m=ade_m))
    assert found.pop(("hall", "lstm", "ade_m")) == expected
    assert set(found.values()) == {"same"}


def test_a_paired_difference_is_judged_by_its_own_interval():
    found = verdicts(changed(ade_m=0.53, ade_m_minus_reference=-0.07))
    assert found["hall", "lstm", "ade_m"] == "within"
    assert found["hall", "lstm", "ade_m_minus_reference"] == "worse"


def test_a_difference_moved_by_the_reference_is_not_judged():
    """A better reference makes the differences of methods worse that stayed as they were."""
    after = changed(ade_m_minus_reference=0.3)
    assert verdicts(after)["hall", "lstm", "ade_m_minus_reference"] == "reference"


def test_a_metric_that_should_be_high_is_worse_when_it_falls(monkeypatch):
    monkeypatch.setitem(METRICS, "hit_rate", Metric("hits", "%", "higher", METRICS["ade_m"].value))
    rates = {"hit_rate": 0.5, "hit_rate_ci95": [0.4, 0.6]}
    fallen, risen = (verdicts(changed(**rates | {"hit_rate": v}), changed(**rates)) for v in (0.3, 0.7))
    assert (fallen["hall", "lstm", "hit_rate"], risen["hall", "lstm", "hit_rate"]) == ("worse", "better")


def test_a_figure_without_an_earlier_interval_is_not_judged():
    before = changed(ade_m_ci95=[None, None])
    assert set(verdicts(before, before).values()) == {"same"}
    assert verdicts(changed(ade_m=0.7), before)["hall", "lstm", "ade_m"] == "unjudged"
    assert verdicts(before)["hall", "lstm", "ade_m"] == "same"
    assert verdicts(changed(ade_m=0.7, ade_m_ci95=[None, None]))["hall", "lstm", "ade_m"] == "worse"


def test_new_and_vanished_entries_are_named():
    after = {"sim": {"hall": {"cv": ENTRY, "mine": ENTRY}}}
    found = verdicts(after)
    assert found["hall", "mine", "ade_m"] == "new"
    assert found["hall", "lstm", "ade_m_minus_reference"] == "vanished"
    assert "| sim | hall | lstm | ade_m |" in changes_table(changes(BEFORE, after))
    assert verdicts(changed(nll=1.0, nll_ci95=[0.9, 1.1]))["hall", "lstm", "nll"] == "new"


@pytest.fixture
def repository(tmp_path):
    """Metrics committed once in a subfolder; the working tree may then differ."""
    folder = tmp_path / "reports" / "metrics"
    folder.mkdir(parents=True)
    (folder / "sim.json").write_text(json.dumps(BEFORE["sim"]))
    (folder / "note.txt").write_text("not a metric")
    git(tmp_path, "init -q", "add .", "commit -qm first")
    return folder


@pytest.mark.parametrize(("ade_m", "code"), [(0.6, 1), (0.52, 0), (0.4, 0)])
def test_the_gate_fails_when_a_figure_got_worse(repository, monkeypatch, ade_m, code):
    (repository / "sim.json").write_text(json.dumps(changed(ade_m=ade_m)["sim"]))
    assert metrics_at("HEAD", repository) == {"sim": BEFORE["sim"]}
    assert metrics_now(repository)["sim"]["hall"]["lstm"]["ade_m"] == ade_m
    monkeypatch.setattr(sys, "argv", ["compare", "HEAD", "--folder", str(repository)])
    with pytest.raises(SystemExit) as ended:
        compare.main()
    assert ended.value.code == code


def test_an_unknown_revision_is_named(repository):
    with pytest.raises(ValueRuleError):
        metrics_at("no-such", repository)
