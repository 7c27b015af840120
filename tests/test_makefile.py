"""What the Makefile installs, where an earlier try ended half way or was made with another Python."""

import os
import shlex
import shutil
import subprocess
import sys

import pytest

from tests.conftest import ROOT

RUNS = f'exec {shlex.quote(sys.executable)} -c "import sys; sys.version_info = VERSION; $2"'


@pytest.fixture
def folder(tmp_path):
    """The Makefile, and a stand-in for Python that makes environments."""
    for name in ("Makefile", "pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, tmp_path)
    executable(tmp_path / ".ci/history", "true")
    return tmp_path


def executable(path, script):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return path


def python(path, version=(3, 12), pip=True):
    """A Python of a version, which notes what pip is to install."""
    version_of = RUNS.replace("VERSION", str((*version, 0)))
    answers = f'*version_info*) {version_of};; "import pip") exit {int(not pip)};; *) exit 0;; esac'
    installs = f'[ "$1 $2" = "-m pip" ] && exec touch {path.parent}/installs'
    executable(path, f'if [ "$1" = -c ]; then case "$2" in {answers}; fi\n{installs}')


def made(folder, *arguments):
    plain = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    return subprocess.run(
        ["make", *arguments], cwd=folder, env=plain, capture_output=True, text=True, check=False
    )


def test_an_environment_of_an_older_python_is_refused_with_what_to_do(folder):
    python(folder / ".venv/bin/python", version=(3, 10))
    run = made(folder, "setup")
    assert run.returncode != 0
    assert ".venv has Python 3.10, and 3.11 or newer is needed: rm -r .venv; make setup PYTHON=" in run.stderr
    assert not (folder / ".venv/bin/installs").exists()


@pytest.mark.parametrize("installed", [True, False])
@pytest.mark.parametrize("left", ["nothing", "no pip", "a link to a Python that is gone"])
def test_an_environment_that_cannot_install_is_made_again(folder, left, installed):
    inside = folder / ".venv/bin/python"
    if left == "no pip":
        python(inside, pip=False)
    elif left != "nothing":
        inside.parent.mkdir(parents=True)
        inside.symlink_to(folder / "gone")
    if installed and left != "no pip":  # what is installed needs no pip
        inside.parent.mkdir(parents=True, exist_ok=True)
        (folder / ".venv/.installed").touch()
    python(folder / "whole")
    cleared = '[ "$3" = --clear ] && rm -rf .venv; mkdir -p .venv/bin'
    copied = f"sed s:{folder}/installs:{inside.parent}/installs: whole > {inside}"
    executable(folder / "maker", f"{cleared}\n{copied} && chmod +x {inside}")
    run = made(folder, "setup", f"PYTHON={folder / 'maker'}")
    assert run.returncode == 0, run.stderr
    assert (folder / ".venv/bin/installs").exists()
    assert (folder / ".venv/.installed").exists()


def test_an_environment_that_works_is_kept(folder):
    python(folder / ".venv/bin/python")
    run = made(folder, "setup", "PYTHON=false")
    assert run.returncode == 0, run.stderr
    assert (folder / ".venv/bin/installs").exists()


@pytest.mark.parametrize("target", ["dist", "audit"])
@pytest.mark.parametrize("left", ["nothing", "no tool", "a link to a Python that is gone"])
def test_a_tool_with_an_environment_of_its_own_runs_whatever_was_left_of_that(folder, target, left):
    inside = folder / "build" / {"dist": "packager", "audit": "audit"}[target] / "bin"
    tools = ("python", "pip", "pip-audit")
    for tool in tools if left == "no tool" else ():
        executable(inside / tool, "exit 1")
    if left == "a link to a Python that is gone":
        for tool in ("pyproject-build", "pip", "pip-audit"):
            executable(inside / tool, "").write_text(f"#!{inside / 'python'}\n")
        (inside / "python").symlink_to(folder / "gone")
    python(folder / ".venv/bin/python")
    (folder / ".venv/.installed").touch()
    executable(folder / "tool", f'case "$*" in --version|install*) ;; *) touch {folder}/ran;; esac')
    copies = "; ".join(f"cp tool {inside / tool}" for tool in tools)
    made_new = f"rm -rf {inside}; mkdir -p {inside}; {copies}"
    executable(folder / ".venv/bin/python", f'[ "$2 $3" = "venv --clear" ] || exit 0\n{made_new}')
    run = made(folder, target)
    assert run.returncode == 0, run.stderr
    assert (folder / "ran").exists()


@pytest.mark.parametrize(
    "broken", ["places tuned_on", "places fitted_on", "tune_tracker one", "fit_social_force two"]
)
def test_tuning_ends_with_the_first_step_that_fails(folder, broken):
    names = 'case "$*" in "-m tools.places"*) echo one; echo two;; esac'
    fails = f'case "$*" in "-m tools.{broken}") exit 1;; esac'
    executable(folder / ".venv/bin/python", f'echo "$*" >> {folder}/calls\n{fails}\n{names}')
    executable(folder / ".venv/bin/dvc", "true")
    (folder / ".venv/.installed").touch()
    assert made(folder, "tune").returncode
    assert (folder / "calls").read_text().splitlines()[-1] == f"-m tools.{broken}"


def test_tuning_takes_place_after_place(folder):
    executable(
        folder / ".venv/bin/python",
        f'echo "$*" >> {folder}/calls; [ "$2" != tools.places ] || echo "one two"',
    )
    executable(folder / ".venv/bin/dvc", "true")
    (folder / ".venv/.installed").touch()
    assert made(folder, "tune").returncode == 0
    called = (folder / "calls").read_text()
    steps = [
        f"-m tools.{tool} {place}"
        for tool in ("tune_tracker", "fit_social_force")
        for place in ("one", "two")
    ]
    assert [line for line in called.splitlines() if line in steps] == steps
