"""The last line of a run says how many tests did not run, and why."""

import subprocess
import sys

import pytest

from tests.conftest import ROOT
from tests.not_run import summary

TESTS = """
import pytest

@pytest.fixture
def recording():
    pytest.skip("needs recordings: hall")

@pytest.mark.parametrize("n", range(3))
def test_with_people(n, recording): ...

@pytest.mark.skipif(True, reason="needs a GPU")
def test_fast(): ...

def test_first(): assert WORKS

def test_last(): ...
"""
SKIPPED = "3 need recordings (hall 3); 1 needs a GPU"


def test_reasons_are_counted_by_what_is_needed():
    recordings = ["needs recordings in A_B: hall", *["needs recordings in A_B: street"] * 1300]
    causes = "1 301 need recordings in A_B (street 1 300, hall 1); 2 need a GPU; 1 needs Linux"
    reasons = ["needs a GPU", *recordings, "needs Linux", "needs a GPU"]
    assert summary(reasons, 5900) == f"1 304 of 5 900 tests did not run: {causes}"
    assert summary([], 12) == "0 of 12 tests did not run"


@pytest.mark.parametrize(
    ("works", "options", "end"),
    [
        (True, ["--numprocesses", "2"], f"4 of 6 tests did not run: {SKIPPED}"),
        (False, ["--exitfirst"], f"5 of 6 tests did not run: {SKIPPED}; 1 not reached"),
    ],
    ids=["two workers", "ended"],
)
def test_the_line_is_the_last_one(works, options, end, tmp_path):
    (tmp_path / "conftest.py").write_text("from tests.not_run import pytest_sessionfinish\n")
    (tmp_path / "test_it.py").write_text(TESTS.replace("WORKS", str(works)))
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--rootdir", tmp_path, *options]
    done = subprocess.run([*command, tmp_path], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.stdout.splitlines()[-1] == end, done.stdout
