"""Options of tools and benchmarks are checked before any work is done."""

import argparse
import ast
import importlib
import runpy
import sys
from functools import partial

import pytest

from tests.conftest import ROOT
from tools import arguments

FILES = [*sorted((ROOT / "tools").glob("*.py")), *sorted((ROOT / "benchmarks").glob("*.py"))]
COMMANDS = {
    f"{path.parent.name}.{path.stem}": path.read_text() for path in FILES if "__main__" in path.read_text()
}
WRITTEN = ("--json", "--out", "--table")


def calls():
    """File, name and type of each option of tools and benchmarks."""
    for path in FILES:
        for call in ast.walk(ast.parse(path.read_text())):
            if isinstance(call, ast.Call) and getattr(call.func, "attr", "") == "add_argument":
                kinds = [ast.unparse(key.value) for key in call.keywords if key.arg == "type"]
                yield path, call.args[0].value, kinds[0] if kinds else None


@pytest.mark.parametrize("module", COMMANDS)
def test_help_names_the_module_and_measures_nothing(module, monkeypatch, capsys):
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


def test_tools_and_benchmarks_end_with_a_message_alone():
    guarded = ("@user_errors()\ndef main(", "@config_errors()\ndef main(")
    assert [name for name, text in COMMANDS.items() if not any(how in text for how in guarded)] == []


def test_numbers_of_tools_and_benchmarks_have_a_range():
    assert [(path.stem, name) for path, name, kind in calls() if kind in ("int", "float")] == []


def test_files_to_write_are_checked_before_any_work():
    written = [(path, kind) for path, name, kind in calls() if name in WRITTEN]
    assert len(written) > 5
    unchecked = [p.stem for p, kind in written if kind != "output" and "check_output(o" not in p.read_text()]
    assert unchecked == []


OF_A_PROJECT = [
    ("ablate", "reach"), ("branches",), ("fit_social_force", "eth"), ("places", "tuned_on"), ("prose",),
    ("readme", "--check"), ("recordings",), ("staleness",), ("tune_tracker", "eth"),
]  # fmt: skip


@pytest.mark.parametrize("command", OF_A_PROJECT, ids=" ".join)
def test_outside_of_a_project_a_tool_ends_with_one_error(command, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", list(command))
    with pytest.raises(SystemExit) as exit_of:
        importlib.import_module(f"tools.{command[0]}").main()
    assert str(exit_of.value).count("Error: ") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("kind", "value", "wrong"),
    [
        (arguments.count, 3, ["0", "-1", "1.5", "x", ""]),
        (arguments.positive, 0.5, ["0", "-1", "nan", "inf", "x", ""]),
        (arguments.probability, 0.0, ["1", "-0.1", "nan", "x"]),
    ],
)
def test_numbers_outside_of_their_range_are_refused(kind, value, wrong):
    assert kind(str(value)) == value
    for text in wrong:
        with pytest.raises(argparse.ArgumentTypeError):
            kind(text)


def test_a_file_that_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(argparse.ArgumentTypeError):
        arguments.output(str(tmp_path))
    assert arguments.output(f"{tmp_path}/new/figures.json") == tmp_path / "new/figures.json"
    assert list(tmp_path.iterdir()) == []
