"""What tools and benchmarks do with arguments that they do not know."""

import argparse
import ast
import importlib
import re
import runpy
import sys

import pytest

from tests.conftest import ROOT
from tools import arguments

WITHOUT = ("tools.branches", "tools.mend_lock", "tools.prose", "benchmarks.beside", "benchmarks.growth")
PARSES = ("ArgumentParser(", "table_parser(", "no_arguments(", "sys.argv")


def ended(monkeypatch, module, *arguments):
    """How a command ends that is run as a program, which raises SystemExit."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr("sys.argv", [module, *arguments])
    monkeypatch.delitem(sys.modules, module, raising=False)
    with pytest.raises(SystemExit) as exit_of:
        runpy.run_module(module, run_name="__main__")
    return exit_of.value.code


def test_every_command_looks_at_its_arguments():
    files = [*(ROOT / "tools").glob("*.py"), *(ROOT / "benchmarks").glob("*.py")]
    commands = {path.name: path.read_text() for path in files if "__main__" in path.read_text()}
    assert len(commands) > 20
    assert [name for name, text in commands.items() if not any(how in text for how in PARSES)] == []


def test_every_usage_shows_how_the_command_is_run():
    for folder in ("tools", "benchmarks"):
        for path in (ROOT / folder).glob("*.py"):
            parsers = re.findall(r"ArgumentParser\((.*?)description", path.read_text(), re.DOTALL)
            named = [f'prog="python -m {folder}.{path.stem}"' in before for before in parsers]
            assert all(named) or path.stem in ("arguments", "pages"), path  # these are told the command


def test_the_usage_of_a_table_shows_how_the_command_is_run(monkeypatch, capsys):
    assert ended(monkeypatch, "benchmarks.noise", "--help") == 0
    assert capsys.readouterr().out.startswith("usage: python -m benchmarks.noise [-h]")


@pytest.mark.parametrize("module", WITHOUT)
def test_a_command_without_arguments_does_nothing_when_asked_for_help(module, monkeypatch, capsys):
    assert ended(monkeypatch, module, "--help") == 0
    said = capsys.readouterr()
    assert said.err == ""
    assert said.out.startswith(f"usage: python -m {module} [-h]\n")


def test_an_argument_that_is_not_known_is_named_before_any_work(monkeypatch, capsys):
    assert ended(monkeypatch, "tools.branches", "--jobs", "2") == 2
    assert "unrecognized arguments: --jobs 2" in capsys.readouterr().err


OF_A_PROJECT = [
    ("ablate", "reach"), ("branches",), ("fit_social_force", "eth"), ("places", "tuned_on"), ("prose",),
    ("readme", "--check"), ("recordings",), ("staleness",), ("tune_tracker", "eth"),
]  # fmt: skip


@pytest.mark.parametrize("command", OF_A_PROJECT, ids=" ".join)
def test_where_no_project_is_a_tool_says_so_once(command, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", list(command))
    with pytest.raises(SystemExit) as exit_of:
        importlib.import_module(f"tools.{command[0]}").main()
    assert str(exit_of.value).lower().count("run this in the project's folder") == 1
    assert str(exit_of.value).count("Error: ") == 1
    assert list(tmp_path.iterdir()) == []


COUNTS = {"ablate": "--jobs", "fit_social_force": "--trials", "motion": "--worlds", "tune_tracker": "--ahead"}


@pytest.mark.parametrize("tool", COUNTS)
def test_a_number_of_nothing_is_refused(tool, monkeypatch, capsys):
    option = COUNTS[tool]
    monkeypatch.setattr("sys.argv", [tool, "reach", option, "0"])
    with pytest.raises(SystemExit):
        importlib.import_module(f"tools.{tool}").main()
    assert f"argument {option}: '0': it must be a whole number of at least 1" in capsys.readouterr().err


FILES = [*sorted((ROOT / "tools").glob("*.py")), *sorted((ROOT / "benchmarks").glob("*.py"))]
WRITTEN = ("--json", "--out", "--table")
PARTS = ("feature_memory", "ros_stream", "watch")
"""Processes that a benchmark starts."""


def options():
    """File, name and type of each option of tools and benchmarks."""
    for path in FILES:
        for call in ast.walk(ast.parse(path.read_text())):
            if isinstance(call, ast.Call) and getattr(call.func, "attr", "") == "add_argument":
                kinds = [ast.unparse(key.value) for key in call.keywords if key.arg == "type"]
                yield path, call.args[0].value, kinds[0] if kinds else None


def test_numbers_of_tools_and_benchmarks_have_a_range():
    assert [(path.stem, name) for path, name, kind in options() if kind in ("int", "float")] == []


def test_files_of_tools_and_benchmarks_are_known_to_be_writable_before_any_work():
    written = [(path, kind) for path, name, kind in options() if name in WRITTEN]
    assert len(written) > 10
    assert [
        path.stem for path, kind in written if kind != "output" and "check_output(o" not in path.read_text()
    ] == []


def test_tools_and_benchmarks_end_with_a_message_alone():
    commands = {path.stem: path.read_text() for path in FILES if "__main__" in path.read_text()}
    guarded = ("@user_errors()\ndef main(", "@config_errors()\ndef main(")
    unguarded = {name for name, text in commands.items() if not any(how in text for how in guarded)}
    assert unguarded - set(PARTS) == set()


@pytest.mark.parametrize("text", ["0", "-1", "nan", "inf", "x", ""])
def test_an_amount_of_nothing_is_refused(text):
    with pytest.raises(argparse.ArgumentTypeError, match="it must be a number above 0"):
        arguments.positive(text)
    assert arguments.positive("0.5") == 0.5


@pytest.mark.parametrize("text", ["1", "-0.1", "nan", "x"])
def test_what_is_no_probability_is_refused(text):
    with pytest.raises(argparse.ArgumentTypeError, match="it must be a number from 0 to below 1"):
        arguments.probability(text)
    assert arguments.probability("0") == 0.0


def test_a_file_that_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(argparse.ArgumentTypeError, match="it cannot be written: a folder is there"):
        arguments.output(str(tmp_path))
    assert arguments.output(f"{tmp_path}/new/figures.json") == tmp_path / "new/figures.json"
    assert list(tmp_path.iterdir()) == []
