"""`pedpred drive`: tables that grow, do not depend on how they grew, and refuse to be mixed."""

import os
import re
import signal
import subprocess
import sys
from functools import partial

import numpy as np
import pytest

import pedpred
from pedpred.command import driving, main
from pedpred.command.recordings import open_scene
from pedpred.driving.figures import Episodes, equal_time, figures_of, summary
from pedpred.driving.measures import Measures
from pedpred.driving.table import Condition, Row, read_table, write_table
from tests.conftest import ROOT

MODEL = ROOT / "models/online/default"
CORNER = str(ROOT / "examples" / "corner" / "people.mcap")


def driven(table, *options):
    main(["drive", CORNER, "--table", str(table), *options])
    return table.read_bytes()


def test_a_table_is_the_same_however_it_grew(tmp_path, capsys):
    methods = "--method", "standing", "--method", "kalman", "--risk", "0.1"
    whole = driven(tmp_path / "whole.csv", "--episodes", "3", *methods, "--processes", "2")
    assert "standing" in capsys.readouterr().out
    driven(tmp_path / "grown.csv", "--episodes", "2", *methods[2:])
    assert driven(tmp_path / "grown.csv", "--episodes", "3", *methods) == whole
    before = (tmp_path / "grown.csv").stat()
    assert driven(tmp_path / "grown.csv", "--episodes", "2", *methods) == whole
    assert before.st_size == len(whole)


def test_an_interrupted_run_continues_where_it_was(tmp_path):
    """Ctrl-C ends workers quietly and keeps what is done; the rest gives the bytes of an undisturbed run."""
    table, whole = tmp_path / "table.csv", tmp_path / "whole.csv"
    methods = "--method", "standing", "--method", "kalman", "--risk", "0.1"
    command = [sys.executable, "-m", "pedpred.command", "drive", CORNER, "--table", str(table), *methods]
    command += ["--episodes", "5000", "--processes", "2"]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("TQDM_")}
    environment["TQDM_MININTERVAL"] = "0"
    default = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # which background jobs ignore
    how = {"stderr": subprocess.PIPE, "text": True, "cwd": ROOT, "env": environment, "preexec_fn": default}
    with subprocess.Popen(command, **how) as started:
        while not re.search(r" [2-9]/5000", started.stderr.readline()):  # each state of the bar is a line
            assert started.poll() is None
        started.send_signal(signal.SIGINT)
        assert "Traceback" not in started.communicate(timeout=120)[1]
        assert started.returncode == 130
    done = 1 + max(row.episode for row in read_table(table))
    assert done >= 2
    options = *methods, "--episodes", str(done + 1)
    assert driven(table, *options) == driven(whole, *options)


def test_drives_that_another_run_adds_meanwhile_stay(tmp_path, monkeypatch):
    table, few, usual = tmp_path / "table.csv", ("--episodes", "2", "--risk", "0.1"), driving.run

    def run(*given):
        monkeypatch.setattr(driving, "run", usual)
        yield from usual(*given)
        driven(table, *few, "--method", "standing")

    monkeypatch.setattr(driving, "run", run)
    driven(table, *few, "--method", "kalman")
    assert [row.condition.method for row in read_table(table)].count("standing") == 2


def test_drives_of_other_settings_networks_or_versions_are_not_(tmp_path, monkeypatch):
    table, options = tmp_path / "table.csv", ("--episodes", "1", "--method", "standing")
    before = driven(table, *options)
    with pytest.raises(SystemExit):
        driven(table, *options, "--seed", "1")
    unnamed = before.replace(b"standing", b"other")
    table.write_bytes(unnamed)
    with pytest.raises(SystemExit):
        driven(table, "--episodes", "2", *options[2:])
    assert table.read_bytes() == unnamed
    table.write_bytes(before)
    monkeypatch.setattr(pedpred, "__version__", "0.0.1", raising=False)
    with pytest.raises(SystemExit):
        driven(table, *options)
    assert table.read_bytes() == before


def test_another_file_than_a_table_of_drives_stays(tmp_path):
    table = tmp_path / "table.csv"
    table.write_bytes(content := b"place,robot\nhere,there\n")
    with pytest.raises(SystemExit):
        driven(table, "--episodes", "1", "--method", "standing")
    assert table.read_bytes() == content


def test_an_episode_is_recorded_with_the_robot(tmp_path):
    recording = tmp_path / "episode.mcap"
    main(["drive", CORNER, "--record", str(recording)])
    people = open_scene(recording).trajectories
    robot = people.track_id == people.track_id.max()
    assert np.hypot(*np.ptp(people.position[robot], axis=0)) > 3.0


@pytest.mark.parametrize(
    ("place", "options"),
    [
        ("", ""),
        (CORNER, "--world corridor"),
        (CORNER, "--people react"),
        (CORNER, "--curves curves.svg"),
        (CORNER, "--record x.png --table drives.csv"),
        (CORNER, "--record x.mcap --method true_future"),
        (CORNER, "--compare other=nowhere"),
        (CORNER, f"--compare modes={MODEL}"),
        (CORNER, "--speed-mps 5.7"),
    ],
)
def test_options_that_contradict_each_other_are_refused(place, options, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(driving, "open_scene", lambda *given: pytest.fail("a recording is read"))
    (tmp_path / "people.mcap").touch()
    with pytest.raises(SystemExit):
        main(["drive", *place.split(), *options.split()])
    assert [path.name for path in tmp_path.iterdir()] == ["people.mcap"]


def test_a_run_that_drives_nothing_leaves_no_table(tmp_path):
    with pytest.raises(SystemExit):
        driven(tmp_path / "table.csv", "--episodes", "1", "--method", "standing", "--radius-m", "5")
    assert not list(tmp_path.iterdir())


def test_another_network_is_compared_by_its_name(tmp_path, capsys):
    """The default model beside itself drives the same; a later run adds it to a table without it."""
    table = tmp_path / "table.csv"
    options = "--episodes", "1", "--method", "modes", "--risk", "0.1"
    alone = driven(table, *options)
    both = driven(table, *options, "--compare", f"other={MODEL}")
    one, other = read_table(table)
    assert (other.condition.method, other.measures) == ("other", one.measures)
    assert both.startswith(alone)
    assert "other" in capsys.readouterr().out


def test_worlds_are_driven_in_like_a_scene(tmp_path, capsys):
    table = tmp_path / "worlds.csv"
    asked = ["drive", "--world", "square", "--episodes", "1", "--method", "true_future"]
    asked += ["--table", str(table)]
    main([*asked, "--people", "ignore"])
    assert "square_ignore" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(asked)


def row(condition, episode, faults, time_s):
    figures = dict.fromkeys(Measures.__annotations__, 1) | {"faults": faults, "time_s": time_s}
    return Row("here", "differential", condition, episode, "0", Measures(**figures))


def test_a_table_comes_back_as_it_was(tmp_path):
    rows = [row(Condition("modes", 0.1), e, e % 2, 0.125 * e) for e in range(5)]
    write_table(tmp_path / "table.csv", rows[::-1])
    assert read_table(tmp_path / "table.csv") == rows
    assert "modes" in summary(figures_of(rows))


def test_curves_are_compared_at_equal_time():
    """Half as many collisions at every time, with curves that begin elsewhere."""
    rng = np.random.default_rng(0)
    rows = []
    for method, share, times in (("kalman", 0.4, (8.0, 12.0)), ("modes", 0.2, (9.0, 13.0))):
        for risk, time_s in zip((0.3, 0.1), times, strict=True):
            hit = rng.permutation(1000) < 1000 * share
            rows += [row(Condition(method, risk), e, int(hit[e]), time_s) for e in range(1000)]
    found = equal_time(Episodes.of(rows), "modes", "kalman")
    apart, (low, high) = found["at_fault"], found["at_fault_ci95"]
    assert found["time_s"] == pytest.approx(10.5)
    assert apart == pytest.approx(-0.2)
    assert -0.25 < low < apart < high < -0.15
    assert equal_time(Episodes.of(rows), "modes", "standing") is None
