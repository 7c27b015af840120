"""The tables of results on the pages: they hold the metrics, and stay while a place is missing."""

import json
import shutil

from pedpred.report.methods import Methods
from tests.conftest import ROOT
from tools import readme


def test_the_tables_on_the_pages_are_those_of_the_metrics():
    """`make readme` writes them."""
    written = readme.pages(ROOT)
    assert {str(path.relative_to(ROOT)) for path in written} >= {"README.md", "docs/models/default.md"}
    assert [path for path, text in written.items() if path.read_text() != text] == []


def test_table_has_a_row_per_method_and_training():
    methods = {
        "cv": {"label": "CV", "role": "baseline"},
        "goal": {"label": "Goal", "role": "oracle"},
        "net": {"label": "Net", "role": "network"},
        "later": {"label": "Later", "role": "network"},  # not evaluated yet
    }
    rest = {
        "ade_m_ci95": (0.1, 0.2),
        "fde_m_ci95": (0.1, 0.2),
        "windows": 7,
        "min_ade_m_k6": None,
        "nll": 1.0,
    }

    def place(**ade_m):
        return {"a_hall": {name: {"ade_m": m, "fde_m": 2 * m} | rest for name, m in ade_m.items()}}

    studies = {"transfer": place(cv=0.4, goal=0.1, net=0.3), "real": place(cv=0.4, goal=0.1, net=0.2)}
    tables = readme.tables_from(studies, Methods.parse(methods, "cv"))
    assert [line.split(" |")[0] for line in tables["unseen"].splitlines()[2:]] == [
        *("| CV", "| Goal", "| Net, simulation only", "| Net, fine-tuned on the other places"),
    ]
    assert tables["unseen"].count("**") == 2  # the best, but no oracle
    assert "**0.200** (0.100-0.200)" in tables["unseen"]
    assert "relative to CV: a hall -50 %" in tables["headline"]
    assert tables["main"].count("| a hall |") == 2


def test_tables_stay_while_a_tested_place_has_no_figures(tmp_path):
    shutil.copy(ROOT / "params.yaml", tmp_path)
    for name in ("reports/metrics", "conf/report"):
        shutil.copytree(ROOT / name, tmp_path / name)
    (tmp_path / "README.md").write_text("<!-- table: unseen -->\nold\n<!-- end -->\n")
    assert "lab corner" in readme.pages(tmp_path)[tmp_path / "README.md"]
    path = tmp_path / "reports/metrics/real.json"
    found = json.loads(path.read_text())
    del found["lab_corner"]
    path.write_text(json.dumps(found))
    assert readme.pages(tmp_path) == {}
