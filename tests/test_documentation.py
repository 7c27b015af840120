"""The tables of results on the pages: they hold the metrics, and stay while a place is missing."""

import json
import shutil

from tests.conftest import ROOT
from tools import readme


def test_the_tables_on_the_pages_are_those_of_the_metrics():
    """`make readme` writes them."""
    written = readme.pages(ROOT)
    assert {str(path.relative_to(ROOT)) for path in written} >= {"README.md", "docs/models/default.md"}
    assert [path for path, text in written.items() if path.read_text() != text] == []


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
