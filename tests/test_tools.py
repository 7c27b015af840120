"""Tools and benchmarks start, check their arguments before any work, and sum up what is there."""

import argparse
import importlib
import runpy
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from benchmarks import robustness, tables
from pedpred.errors import InputError
from pedpred.scenes import Scene
from pedpred.storage.scenes import write_scene
from tests.conftest import ROOT
from tests.worlds import walled_scene
from tools import arguments
from tools.motion import describe_motion
from tools.places import recordings

FILES = [*sorted((ROOT / "tools").glob("*.py")), *sorted((ROOT / "benchmarks").glob("*.py"))]
COMMANDS = {
    f"{path.parent.name}.{path.stem}": path.read_text() for path in FILES if "__main__" in path.read_text()
}
OF_A_PROJECT = [("ablate", "reach"), ("places", "tuned_on"), ("prose",), ("readme",), ("recordings",)]
OF_A_PROJECT += [("fit_social_force", "eth"), ("tune_tracker", "eth")]


@pytest.mark.parametrize("module", COMMANDS)
def test_command_starts_and_names_its_module(module, monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr("sys.argv", [module, "--help"])
    if "no_arguments(" in COMMANDS[module]:
        monkeypatch.delitem(sys.modules, module, raising=False)
        run = partial(runpy.run_module, module, run_name="__main__")
    else:
        run = importlib.import_module(module).main
    with pytest.raises(SystemExit) as ended:
        run()
    assert ended.value.code == 0
    assert capsys.readouterr().out.startswith(f"usage: python -m {module} ")


@pytest.mark.parametrize("command", OF_A_PROJECT, ids=" ".join)
def test_tool_outside_of_a_project_ends_with_one_error(command, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", list(command))
    with pytest.raises(SystemExit) as ended:
        importlib.import_module(f"tools.{command[0]}").main()
    assert str(ended.value).count("Error: ") == 1
    assert list(tmp_path.iterdir()) == []


def test_argument_out_of_range_is_refused():
    for kind, value, wrong in (
        (arguments.count, 3, ["0", "1.5", "x"]),
        (arguments.positive, 0.5, ["0", "nan", "inf", "x"]),
        (arguments.probability, 0.0, ["1", "-0.1", "nan", "x"]),
        (arguments.output, ROOT / "new/figures.json", [str(ROOT)]),
    ):
        assert kind(str(value)) == value
        for text in wrong:
            with pytest.raises(argparse.ArgumentTypeError):
                kind(text)


def test_recordings_are_places_with_people_or_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    places, missing = Path("data/scenes/real"), Scene.without_people("hotel", "ask for it")
    write_scene(missing, places / "hotel")
    for files in ([], [places / "hotel"]):
        with pytest.raises(InputError):
            list(recordings(files))
    write_scene(walled_scene(np.random.default_rng(0)), places / "hall")
    assert len(list(recordings([]))) == 1
    (scene,) = recordings([ROOT / "examples/crossing/tracks.csv"])
    assert len(scene.trajectories) == 1340
    assert describe_motion("hotel", [missing])["instants"] == 0


# Benchmarks


def test_table_is_written_between_its_marks(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("<!-- table: noise -->\nold\n<!-- end -->\n<!-- table: bias -->\nold\n<!-- end -->\n")
    tables.write_tables(page, {"noise": [{"place": "a|b", "m": 0.5}], "bias": []})
    assert page.read_text() == (
        "<!-- table: noise -->\n| place | m |\n| --- | ---: |\n| a\\|b | 0.500 |\n<!-- end -->\n"
        "<!-- table: bias -->\nold\n<!-- end -->\n"
    )


def test_robustness_finds_larger_errors_with_more_noise(monkeypatch, model):
    monkeypatch.setattr(robustness, "NOISES_M", (0.0, 0.1))
    shown = []
    monkeypatch.setattr(robustness, "show", lambda _, rows: shown.extend(rows))
    robustness.main(["noise", str(ROOT / "examples/corner/walk.txt"), "--model", str(model[0])])
    ((place, exact, noisy),) = (row.values() for row in shown)
    assert place == "walk"
    assert float(exact.split()[0]) < float(noisy.split()[0])
