"""The regression gate: what moved beyond its interval is listed, and worse figures fail."""

import copy
import json
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.errors import ValueRuleError
from pedpred.metrics import METRICS, Metric
from tests.plain_git import git
from tools import compare
from tools.compare import changes, changes_table, metrics_at

ENTRY = {"ade_m": 0.5, "ade_m_ci95": [0.45, 0.55], "fde_m": 1.0, "fde_m_ci95": [0.9, 1.1]}
ENTRY |= {"windows": 10, "per_step_m": [0.1, 1.0]}
GAP = {"ade_m_minus_reference": -0.1, "ade_m_minus_reference_ci95": [-0.12, -0.08]}
BEFORE = {"sim": {"hall": {"cv": ENTRY, "lstm": ENTRY | GAP}}, "walking": {"hall": {"states": 5}}}


def changed(**figures):
    after = copy.deepcopy(BEFORE)
    after["sim"]["hall"]["lstm"] |= figures
    return after


def verdicts(after, before=BEFORE):
    """Verdicts by place, method and figure."""
    found = changes(before, after)
    return found.set_index(["place", "method", "figure"])["verdict"].to_dict()


def verdict(figure, after, before=BEFORE):
    return verdicts(after, before)["hall", "lstm", figure]


@given(st.floats(0.1, 0.9))
def test_figure_is_judged_by_its_earlier_interval(ade_m):
    expected = "worse" if ade_m > 0.55 else "better" if ade_m < 0.45 else "within" if ade_m != 0.5 else "same"
    found = verdicts(changed(ade_m=ade_m))
    assert found.pop(("hall", "lstm", "ade_m")) == expected
    assert len(found) == 4
    assert set(found.values()) == {"same"}


def test_paired_difference_is_judged_if_its_method_moved():
    """A better reference makes the differences of methods worse that stayed as they were."""
    gap = "ade_m_minus_reference"
    assert verdict("ade_m", changed(ade_m=0.53, ade_m_minus_reference=-0.07)) == "within"
    assert verdict(gap, changed(ade_m=0.53, ade_m_minus_reference=-0.07)) == "worse"
    assert verdict(gap, changed(ade_m_minus_reference=0.3)) == "reference"


def test_metric_that_should_be_high_is_worse_when_it_falls(monkeypatch):
    monkeypatch.setitem(METRICS, "hit_rate", Metric("hits", "%", "higher", METRICS["ade_m"].value))
    rates = {"hit_rate": 0.5, "hit_rate_ci95": [0.4, 0.6]}
    for value, expected in ((0.3, "worse"), (0.7, "better")):
        assert verdict("hit_rate", changed(**rates | {"hit_rate": value}), changed(**rates)) == expected


def test_figure_without_an_earlier_interval_is_not_judged():
    before = changed(ade_m_ci95=[None, None])
    assert verdict("ade_m", changed(ade_m=0.7), before) == "unjudged"
    assert verdict("ade_m", BEFORE, before) == "same"
    assert verdict("ade_m", changed(ade_m=0.7, ade_m_ci95=[None, None])) == "worse"


def test_new_and_vanished_entries_are_named():
    after = {"sim": {"hall": {"cv": ENTRY, "mine": ENTRY}}}
    found = verdicts(after)
    assert found["hall", "mine", "ade_m"] == "new"
    assert found["hall", "lstm", "ade_m_minus_reference"] == "vanished"
    assert "| sim | hall | lstm | ade_m |" in changes_table(changes(BEFORE, after))


@pytest.mark.parametrize(("ade_m", "code"), [(0.6, 1), (0.52, 0)])
def test_gate_fails_when_a_figure_got_worse(ade_m, code, tmp_path, monkeypatch):
    folder = tmp_path / "reports" / "metrics"
    folder.mkdir(parents=True)
    (folder / "sim.json").write_text(json.dumps(BEFORE["sim"]))
    (folder / "note.txt").write_text("not a metric")
    git(tmp_path, "init -q", "add .", "commit -qm first")
    (folder / "sim.json").write_text(json.dumps(changed(ade_m=ade_m)["sim"]))
    assert metrics_at("HEAD", folder) == {"sim": BEFORE["sim"]}
    with pytest.raises(ValueRuleError):
        metrics_at("no-such", folder)
    monkeypatch.setattr(sys, "argv", ["compare", "HEAD", "--folder", str(folder)])
    with pytest.raises(SystemExit) as ended:
        compare.main()
    assert ended.value.code == code
