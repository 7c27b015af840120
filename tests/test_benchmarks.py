"""Benchmarks: tables, times and busy processes, and each benchmark at its smallest size."""

import dataclasses
import subprocess
import sys
from itertools import product

import pytest

from benchmarks import driving, robustness, tables
from benchmarks.ros import end
from benchmarks.train import cases
from pedpred.driving.measures import Measures
from pedpred.driving.table import Condition, Row, write_table
from pedpred.training.distributed import ALONE
from pedpred.training.loop import train_step
from tests.conftest import ROOT

WALK = str(ROOT / "examples/corner/walk.txt")


def test_processes_that_ignore_the_request_to_end_are_killed():
    waits = "import signal, time; print(flush=True); time.sleep(60)"
    deaf = waits.replace(";", "; signal.signal(signal.SIGTERM, signal.SIG_IGN);", 1)
    commands = [waits, deaf, deaf]
    started = [subprocess.Popen([sys.executable, "-c", each], stdout=subprocess.PIPE) for each in commands]
    for process in started:
        process.stdout.readline()
    end(started, 0.5)
    for process in started:
        process.stdout.close()
    assert [process.poll() for process in started] == [-15, -9, -9]


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


# Tables


def test_a_table_is_written_between_its_marks(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("<!-- table: noise -->\nold\n<!-- end -->\n<!-- table: bias -->\nold\n<!-- end -->\n")
    tables.write_tables(page, {"noise": [{"place": "a|b", "m": 0.5}], "bias": []})
    assert page.read_text() == (
        "<!-- table: noise -->\n| place | m |\n| --- | ---: |\n| a\\|b | 0.500 |\n<!-- end -->\n"
        "<!-- table: bias -->\nold\n<!-- end -->\n"
    )


# Robustness

SMALL = {
    "NOISES_M": (0.0, 0.1),
    "RATES_HZ": (1.0,),
    "TURNS_RADPS": (0.4,),
    "TURN_NOISES_M": (0.0,),
    "TURN_RATES_HZ": (2.5,),
    "WIDTHS_M": (1.0,),
}


@pytest.fixture
def small(monkeypatch, model):
    """Runs a study at its smallest size; returns the rows."""
    for name, values in SMALL.items():
        monkeypatch.setattr(robustness, name, values)
    shown = []
    monkeypatch.setattr(robustness, "show", lambda _, rows: shown.append(rows))

    def run(*arguments):
        robustness.main([*arguments, "--model", str(model[0])])
        return shown[-1]

    return run


def test_noise_increases_errors(small):
    for study in ("noise", "alone"):
        ((place, exact, noisy),) = (row.values() for row in small(study, WALK))
        assert place == "walk"
        assert float(exact.split()[0]) < float(noisy.split()[0])


def test_bias_has_the_truth_beside_constant_velocity(small):
    for row in small("bias", WALK):
        assert row["windows"] >= robustness.FEWEST_WINDOWS
        assert row["truth"] < row["cv"]  # people turn at the corner


# Pages


# Drives


def drives(place, *methods):
    """Drives of some methods at a place, with a collision in each other episode."""
    names = [field.name for field in dataclasses.fields(Measures)]
    rows = []
    for method, number in product(methods, range(4)):
        measures = Measures(**dict.fromkeys(names, number % 2) | {"time_s": 10.0 + len(method)})
        for risk in (0.0,) if method in ("standing", "true_future") else (0.1, 0.2):
            rows.append(Row(place, "car", Condition(method, risk), number, "", measures))
    return rows


def test_tables_of_drives_have_the_places_of_their_methods(tmp_path):
    write_table(tmp_path / "a.csv", drives("a", "standing", "kalman", "modes", "true_future"))
    write_table(tmp_path / "b.csv", drives("b", "modes", "kalman"))
    tables_of = driving.tables_of(driving.drives_in([tmp_path / "a.csv", tmp_path / "b.csv"]))
    assert [row["place"] for row in tables_of["equal"]] == ["a"]
    assert tables_of["extremes"] == [{"place": "a", "`standing`": "2 of 4", "`true_future`": "2 of 4"}]
    places = {key for row in tables_of["curves"] for key in row if "episodes" in key}
    assert places == {"a (4 episodes)", "b (4 episodes)"}
