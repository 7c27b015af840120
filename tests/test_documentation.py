"""Pages: code that imports what exists, tables that are up to date, links, length and style."""

import json
import re
import shutil
from importlib import import_module

import pytest
import yaml

from pedpred.report.methods import Methods
from tests.conftest import ROOT
from tests.test_page_commands import PAGES, blocks
from tools import prose, readme


@pytest.mark.parametrize("page", PAGES)
def test_python_on_a_page_compiles_and_imports_what_exists(page):
    for code in blocks(PAGES[page], "python"):
        compile(code, page, "exec")
        for line in re.findall(r"^(?:from pedpred|import pedpred).*$", code, re.MULTILINE):
            exec(line, {})


@pytest.mark.parametrize("page", PAGES)
def test_yaml_on_a_page_is_yaml(page):
    for text in blocks(PAGES[page], "yaml"):
        assert yaml.safe_load(text)


# Tables of results


def test_the_tables_on_the_pages_are_those_of_the_metrics():
    """`make readme` writes them."""
    written = readme.pages(ROOT)
    assert {str(path.relative_to(ROOT)) for path in written} >= {"README.md", "docs/models/default.md"}
    assert [path for path, text in written.items() if path.read_text() != text] == []


def figures(**errors):
    about = {
        "ade_m_ci95": (0.1, 0.2),
        "fde_m_ci95": (0.1, 0.2),
        "windows": 7,
        "min_ade_m_k6": None,
        "nll": 1.0,
    }
    return {key: {"ade_m": value, "fde_m": 2 * value, **about} for key, value in errors.items()}


def test_a_table_has_a_row_per_method_and_training_and_marks_the_best():
    plain = {
        "cv": {"label": "CV", "role": "baseline"},
        "goal": {"label": "Goal", "role": "oracle"},
        "net": {"label": "Net", "role": "network"},
        "later": {"label": "Later", "role": "network"},
    }
    studies = {
        "transfer": {"a_hall": figures(cv=0.4, goal=0.1, net=0.3)},
        "real": {"a_hall": figures(cv=0.4, goal=0.1, net=0.2)},
    }
    tables = readme.tables_from(studies, Methods.parse(plain, "cv"))
    assert [line.split(" |")[0] for line in tables["unseen"].splitlines()[2:]] == [
        *("| CV", "| Goal", "| Net, simulation only", "| Net, fine-tuned on the other places"),
    ]
    assert tables["unseen"].count("**") == 2
    assert "**0.200** (0.100-0.200)" in tables["unseen"]
    assert tables["places"].splitlines()[0].split(" | ")[1:] == [
        *("CV", "Net, simulation only", "Net, fine-tuned on the other places |"),
    ]
    assert tables["places"].splitlines()[2].count("**0.200**") == 1
    assert "relative to CV: a hall -50 %" in tables["headline"]
    assert tables["main"].count("| a hall |") == 2


def test_tables_stay_while_a_tested_place_has_no_figures(tmp_path, caplog):
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
    assert "lab_corner" in caplog.text


# Style


def test_quaint_phrases_and_long_pages_are_found():
    words = {"so many thing": "things"}
    text = "`so many thing`\n\n```\nso many thing\n```\nsee so\nmany thing"
    assert list(prose.faults(text, "a.md", words)) == ["a.md:6: 'so many thing', write: things"]
    (fault,) = prose.faults("x\n" * 121, "README.md", {})
    assert "121 lines, at most 120" in fault


# The interface


def test_the_interface_describes_what_is_there():
    """A member that a module lacks is left out of the site without a word."""
    named = r"^::: (\S+)\n    options:\n      members: \[(.*)\]$"
    api = "\n".join(text for page, text in PAGES.items() if page.startswith("docs/api/"))
    members = {module: names.split(", ") for module, names in re.findall(named, api, re.MULTILINE)}
    assert len(members) >= 15
    missing = [f"{m}.{n}" for m, names in members.items() for n in names if not hasattr(import_module(m), n)]
    assert missing == []
