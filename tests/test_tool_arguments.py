"""What tools and benchmarks do with arguments that they do not know."""

import importlib
import subprocess
import sys

import pytest

from tests.conftest import ROOT

WITHOUT = ("tools.branches", "tools.mend_lock", "tools.prose", "benchmarks.beside", "benchmarks.growth")
PARSES = ("ArgumentParser(", "no_arguments(", "sys.argv")


def called(module, *arguments):
    command = [sys.executable, "-m", module, *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=60)


def test_every_command_looks_at_its_arguments():
    files = [*(ROOT / "tools").glob("*.py"), *(ROOT / "benchmarks").glob("*.py")]
    commands = {path.name: path.read_text() for path in files if "__main__" in path.read_text()}
    assert len(commands) > 20
    assert [name for name, text in commands.items() if not any(how in text for how in PARSES)] == []


@pytest.mark.parametrize("module", WITHOUT)
def test_a_command_without_arguments_does_nothing_when_asked_for_help(module):
    done = called(module, "--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"usage: python -m {module} [-h]\n")


def test_an_argument_that_is_not_known_is_named_before_any_work():
    done = called("tools.branches", "--jobs", "2")
    assert done.returncode == 2
    assert "unrecognized arguments: --jobs 2" in done.stderr


COUNTS = {"ablate": "--jobs", "fit_social_force": "--trials", "motion": "--worlds", "tune_tracker": "--ahead"}


@pytest.mark.parametrize("tool", COUNTS)
def test_a_number_of_nothing_is_refused(tool, monkeypatch, capsys):
    option = COUNTS[tool]
    monkeypatch.setattr("sys.argv", [tool, "reach", option, "0"])
    with pytest.raises(SystemExit):
        importlib.import_module(f"tools.{tool}").main()
    assert f"argument {option}: '0': it must be a whole number of at least 1" in capsys.readouterr().err
