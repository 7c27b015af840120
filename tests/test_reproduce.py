"""`make reproduce` with all recordings, and without; tools and DVC are stand-ins."""

import os
import shutil
import subprocess

import pytest

from tests.conftest import ROOT
from tests.plain_git import git

NOTE = "no raw data of lost: put them here\nTried was nothing.\n"


@pytest.fixture
def folder(tmp_path):
    """A project with one of two data sets and with published results."""
    for name in ("Makefile", "pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, tmp_path)
    shutil.copytree(ROOT / ".ci", tmp_path / ".ci")
    (tmp_path / "data/raw/there").mkdir(parents=True)
    (tmp_path / "data/raw/there/walk.txt").write_text("0 1 2.0 3.0\n")
    (tmp_path / "reports").mkdir()
    for study in ("sim", "real"):
        (tmp_path / f"reports/{study}.md").write_text(f"# published {study}\n\n| all places |\n")
    (tmp_path / ".gitignore").write_text("/data/\n/build/\n/.venv/\n/calls\n")
    git(tmp_path, "init --quiet")
    return tmp_path


def made(folder, code=0, lost=False):
    """`make reproduce` where dvc ends with a code, and one data set is to be had or not."""
    tools = folder / ".venv/bin"
    tools.mkdir(parents=True, exist_ok=True)
    found = f"mkdir -p data/raw/lost; printf '{NOTE}' > data/raw/lost/UNAVAILABLE.txt" if lost else "true"
    say = "head -qn 1 data/raw/lost/* 2> /dev/null || true"
    python = f'case "$*" in *tools.recordings) rm -rf data/raw/lost; {found}; {say};; esac\n'
    dvc = 'case "$*" in repro\\ --keep-going) for s in sim real; do '
    dvc += f"printf '# here %s\\n\\n| here |\\n' $s > reports/$s.md; done;; esac\nexit {code}\n"
    for name, script in (("dvc", dvc), ("python", python)):
        log = f'echo "$(basename "$PWD"): {name} $*" >> {folder}/calls\n'
        (tools / name).write_text(f"#!/bin/sh\n{log}{script}")
        (tools / name).chmod(0o755)
    (folder / ".venv/.installed").touch()
    plain = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    return subprocess.run(
        ["make", "reproduce"], cwd=folder, env=plain, capture_output=True, text=True, check=False
    )


def steps(folder):
    """Calls of tools and DVC so far, each with the name of the folder in which it was made."""
    return (folder / "calls").read_text().splitlines()


@pytest.mark.parametrize("code", [0, 3])
def test_with_all_recordings_results_and_pages_are_written_here(folder, code):
    run = made(folder, code)
    assert (run.returncode == 0) is (code == 0)
    assert "here" in (folder / "reports/real.md").read_text()
    last = ("dvc repro --keep-going", "python -m tools.readme")
    assert steps(folder)[-2:] == [f"{folder.name}: {call}" for call in last]
    assert not (folder / "build").exists()


def test_without_some_recording_results_go_elsewhere_and_published_ones_stay(folder):
    run = made(folder, lost=True)
    assert run.returncode == 0, run.stderr
    said = "no raw data of lost: put them here"
    assert run.stdout.startswith(said), "what is missing is said first,"
    results, last = run.stdout.split("Missing recordings:\n")
    assert "# here real\n| here |" in results
    assert said in last, "and last"
    assert "published real" in (folder / "reports/real.md").read_text()
    assert "here" in (folder / "build/incomplete/reports/real.md").read_text()
    assert (folder / "build/incomplete/data/raw/there/walk.txt").exists()
    assert not any("tools.readme" in step for step in steps(folder))
    assert "incomplete: python -m tools.recordings --stand-in" in steps(folder)


def test_a_failure_elsewhere_is_a_failure(folder):
    assert made(folder, code=3, lost=True).returncode != 0


def test_a_second_call_keeps_the_results_and_takes_everything_else_again(folder):
    made(folder, lost=True)
    copy = folder / "build/incomplete"
    for kept in ("data/features", "models/main/weights", "dvc.lock", "build/state"):
        (copy / kept).parent.mkdir(parents=True, exist_ok=True)
        (copy / kept).write_text("made there\n")
    (folder / "old.py").write_text("old\n")
    (folder / "dvc.lock").write_text("published\n")
    (folder / "models/online/default").mkdir(parents=True)
    (folder / "models/online/default/network.onnx").write_text("published\n")
    made(folder, lost=True)
    assert (copy / "old.py").exists()
    (folder / "old.py").rename(folder / "new.py")
    run = made(folder, lost=True)
    assert run.returncode == 0, run.stderr
    assert not (copy / "old.py").exists()
    assert (copy / "new.py").exists()
    assert (copy / "models/online/default/network.onnx").read_text() == "published\n"
    for kept in ("data/features", "models/main/weights", "dvc.lock", "build/state"):
        assert (copy / kept).read_text() == "made there\n"


def test_once_all_recordings_are_there_results_are_written_here(folder):
    made(folder, lost=True)
    run = made(folder)
    assert run.returncode == 0, run.stderr
    assert "here" in (folder / "reports/real.md").read_text()
