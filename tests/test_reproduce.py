"""`make reproduce` looks for missing raw files again, and ends with what is missing. DVC is a stand-in."""

import os
import shutil
import subprocess

import pytest

from tests.conftest import ROOT


@pytest.fixture
def folder(tmp_path):
    for name in ("Makefile", "pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, tmp_path)
    for name in ("there/walk.txt", "lost/UNAVAILABLE.txt", "lost/hall/UNAVAILABLE.txt"):
        (tmp_path / "data/raw" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "data/raw" / name).write_text("from the last time\n")
    return tmp_path


def made(folder, code, lost):
    """`make reproduce` where dvc ends with a code and finds the lost data set or does not."""
    tools = folder / ".venv/bin"
    tools.mkdir(parents=True)
    after = "mkdir data/raw/lost; echo put it here > data/raw/lost/UNAVAILABLE.txt" if lost else "true"
    first = f'case "$*" in *--keep-going*) ls data/raw > before; {after};; esac'
    dvc = f'echo "$*" >> calls\n{first}\nexit {code}\n'
    for name, script in (("dvc", dvc), ("python", "")):
        (tools / name).write_text(f"#!/bin/sh\n{script}")
        (tools / name).chmod(0o755)
    (folder / ".venv/.installed").touch()
    plain = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    return subprocess.run(
        ["make", "reproduce"], cwd=folder, env=plain, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("code", [0, 3])
@pytest.mark.parametrize("lost", [True, False])
def test_notes_are_removed_before_and_shown_afterwards(folder, code, lost):
    run = made(folder, code, lost)
    assert (folder / "before").read_text() == "there\n"
    assert (run.returncode == 0) is (code == 0)
    assert run.stdout.endswith("put it here\n") is lost
    assert "from the last time" not in run.stdout
    assert ("--single-item fetch" in (folder / "calls").read_text()) is (code != 0)
