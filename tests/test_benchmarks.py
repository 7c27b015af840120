"""Benchmarks: what they need and do not find, and how they compare times."""

import numpy as np
import pytest

from benchmarks import online
from benchmarks.beside import busy, slowdown
from benchmarks.learners import cases
from benchmarks.pages import put
from benchmarks.timing import tell
from pedpred.training.distributed import ALONE
from pedpred.training.loop import train_step


def test_what_is_missing_is_named_with_the_command_that_makes_it(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.argv", ["online", "--model", str(tmp_path / "nowhere")])
    with pytest.raises(SystemExit) as ended:
        online.main()
    assert ended.value.code == f"{tmp_path}/nowhere is missing; make it: dvc repro export"


def test_a_slowdown_is_that_of_the_medians():
    times = iter(np.arange(6.0)[:, None] + 1)  # alone, beside, alone, ...
    found = slowdown(lambda: next(times), 1)
    assert (found["alone_ms"], found["beside_them_ms"], found["ratio"]) == (3.0, 4.0, 4 / 3)


def test_no_busy_process_is_left():
    with busy(2) as started:
        assert all(process.poll() is None for process in started)
    assert all(process.poll() is not None for process in started)


@pytest.mark.parametrize("name", ["lstm_nogrid", "mixture_small"])
def test_a_measured_step_is_one_of_the_training(name):
    case = cases()[name](ALONE)
    batch = next(case.learner.batches(0))
    weights = [p.clone() for p in case.learner.network.parameters()]
    case.load(batch)
    train_step(case.learner, batch, 0)
    moved = [not old.equal(new) for old, new in zip(weights, case.learner.network.parameters(), strict=True)]
    assert any(moved)
    assert case.operations > 1e6


def test_a_benchmark_that_measured_nothing_says_so_and_leaves_the_page(tmp_path, capsys):
    page = tmp_path / "page.md"
    page.write_text("<!-- table: bias -->\nold\n<!-- end -->\n")
    tell("errors", [])
    put("bias", [], page)
    assert capsys.readouterr().out == "\nerrors\n  nothing could be measured\n"
    assert "old" in page.read_text()
