"""Benchmarks: what they need and do not find, and how they compare times."""

import dataclasses
import importlib
import re
import shlex
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from benchmarks import dependencies, driving, driving_curves, online, pages, rates
from benchmarks.beside import busy, slowdown
from benchmarks.learners import cases
from benchmarks.pages import put
from benchmarks.ros import end
from benchmarks.timing import keep, tell
from pedpred.driving.measures import Measures
from pedpred.driving.table import Condition, Row, write_table
from pedpred.errors import InputError
from pedpred.plain import parse_json
from pedpred.training.distributed import ALONE
from pedpred.training.loop import train_step


def test_what_is_missing_is_named_with_the_command_that_makes_it(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.argv", ["online", "--model", str(tmp_path / "nowhere")])
    with pytest.raises(SystemExit) as ended:
        online.main()
    assert ended.value.code == f"{tmp_path}/nowhere is missing; make it: dvc repro export"


def test_no_process_of_a_benchmark_goes_on_after_it():
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
    told = capsys.readouterr()
    assert told.out == "\nerrors\n  nothing could be measured\n"
    assert f"{page}: the table 'bias' stays as it is" in told.err
    assert "old" in page.read_text()


@pytest.mark.parametrize("benchmark", [pages, rates, dependencies])
def test_who_reads_a_page_while_a_benchmark_writes_it_sees_a_whole_one(benchmark, tmp_path, monkeypatch):
    tables = "".join(f"<!-- table: {name} -->\nold\n<!-- end -->\n" for name in ("rates", "dependencies"))
    page, old = tmp_path / "page.md", f"python -m benchmarks.rates --write\n{tables}"
    page.write_text(old)
    if benchmark is pages:
        monkeypatch.setattr(benchmark, "main", lambda: put("rates", [{"frames": "new"}], page), raising=False)
    else:
        monkeypatch.setattr(benchmark, {rates: "_PAGE", dependencies: "PAGE"}[benchmark], page)
        monkeypatch.setattr(
            benchmark, {rates: "table_of", dependencies: "table"}[benchmark], lambda *_: "new"
        )
    monkeypatch.setattr("sys.argv", ["benchmark", "--write"])
    with page.open() as reader:
        benchmark.main()
        assert reader.read() == old
    assert "new" in page.read_text()


BEGINS = {
    "bias": "recordings",
    "corridors": "mean_reach",
    "curves": "walkers",
    "driving": "in_parallel",
    "driving_curves": "driven_in",
    "noise": "recordings",
    "other_people": "rows_of",
    "rates": "recordings",
}
"""What each benchmark whose options change a table of a page calls first."""


CHANGES = {
    "bias": ["--model", "models/online/small"],
    "corridors": ["--people", "3"],
    "curves": ["--people", "3"],
    "driving": ["--episodes", "5"],
    "driving_curves": ["people_drives.csv"],
    "noise": ["--seconds", "10"],
    "other_people": ["--model", "models/online/small"],
    "rates": ["--rate", "30"],
}
"""What changes the figures of each of them."""


def written():
    """The commands of the pages that write tables, with the name of the benchmark."""
    for page in (Path("docs")).glob("*.md"):
        for line in re.findall(r"^python -m benchmarks\..* --write\b.*$", page.read_text(), re.MULTILINE):
            words = shlex.split(line, comments=True)
            yield words[2].removeprefix("benchmarks."), words[3:]


WRITTEN = list(written())


class BegunError(Exception):
    """A benchmark has begun to measure."""


def begin(name, arguments, monkeypatch):
    def measure(*_, **__):
        raise BegunError

    module = importlib.import_module(f"benchmarks.{name}")
    monkeypatch.setattr(module, BEGINS[name], measure)
    monkeypatch.setattr("sys.argv", [name, *arguments])
    module.main()


def test_the_pages_show_how_each_of_their_tables_is_written():
    assert {name for name, _ in WRITTEN} == {*BEGINS}


@pytest.mark.parametrize(("name", "arguments"), WRITTEN)
def test_a_table_is_written_by_the_command_of_its_page(name, arguments, monkeypatch):
    elsewhere = [f"/elsewhere/{word}" if "/" in word else word for word in arguments]
    for given in (arguments, elsewhere):
        with pytest.raises(BegunError):
            begin(name, given, monkeypatch)


@pytest.mark.parametrize(("name", "arguments"), WRITTEN)
def test_other_options_than_those_of_the_page_leave_its_table_as_it_is(name, arguments, monkeypatch, capsys):
    """Else the page would have the figures of one command and show another."""
    plain = [word for word in arguments if word != "--write"] + CHANGES[name]
    with pytest.raises(SystemExit, match="2"):
        begin(name, [*plain, "--write"], monkeypatch)
    assert f"python -m benchmarks.{name}" in capsys.readouterr().err
    with pytest.raises(BegunError):
        begin(name, plain, monkeypatch)


@pytest.mark.parametrize("given", ["--variant modes", "--variant modes_wide --variant kalman", "--risk 0.1"])
def test_a_comparison_to_write_is_possible_before_anything_is_driven(given, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["driving", "--world", "room", "--write", *given.split()])
    with pytest.raises(SystemExit, match="2"):
        driving.main()
    assert "--write writes a comparison" in capsys.readouterr().err


def drives(place, *methods):
    """Drives of some methods at a place, with a collision in each other episode."""
    names = [field.name for field in dataclasses.fields(Measures)]
    rows = []
    for method, number in product(methods, range(4)):
        measures = Measures(**dict.fromkeys(names, number % 2) | {"time_s": 10.0 + len(method)})
        for risk in (0.0,) if method in ("standing", "true_future") else (0.1, 0.2):
            rows.append(Row(place, "car", Condition(method, risk), number, "", measures))
    return rows


def test_tables_of_drives_have_the_places_where_their_methods_drove(tmp_path):
    write_table(tmp_path / "a.csv", drives("a", "standing", "kalman", "modes", "true_future"))
    write_table(tmp_path / "b.csv", drives("b", "modes", "kalman"))
    driven = driving_curves.driven_in([tmp_path / "a.csv", tmp_path / "b.csv"])
    tables = driving_curves.tables_of(driven)
    assert [row["place"] for row in tables["equal"]] == ["a"]
    assert tables["tell"] == [{"place": "a", "`standing`": "2 of 4", "`true_future`": "2 of 4"}]
    places = {key for row in tables["curves"] for key in row if "episodes" in key}
    assert places == {"a (4 episodes)", "b (4 episodes)"}


def test_a_place_has_one_table_and_it_has_drives(tmp_path):
    for name, rows in (("one", drives("a", "modes")), ("other", drives("a", "kalman")), ("none", [])):
        write_table(tmp_path / f"{name}.csv", rows)
    with pytest.raises(InputError, match=r"other\.csv: its place, a, is that of an earlier table"):
        driving_curves.driven_in([tmp_path / "one.csv", tmp_path / "other.csv"])
    with pytest.raises(InputError, match=r"none\.csv: no drives are in it"):
        driving_curves.driven_in([tmp_path / "none.csv"])


def test_figures_that_are_no_numbers_are_kept_as_json_that_is_read_again(tmp_path):
    keep({"rows": [{"ms": 1.5, "routing_s": float("nan")}]}, tmp_path / "new" / "figures.json")
    kept = parse_json((tmp_path / "new" / "figures.json").read_text())
    assert kept == {"rows": [{"ms": 1.5, "routing_s": None}]}
