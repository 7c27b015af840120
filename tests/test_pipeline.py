"""The pipeline in a copy of the project: a remote shares results, and nothing goes stale."""

import json
import shutil
import sys
from pathlib import Path

import pytest
import yaml

from tests.configuration import read
from tests.trust.project import ROOT, done

TARGET = "simulate@corridor"
WALKING = Path("pedpred/simulation/kernel.py")
TRACKS = Path("data/scenes/simulated/corridor/corridor/tracks.parquet")
ROWS, MIRRORS = Path("conf/simulations/rooms.yaml"), Path("conf/mirrors/ewap.yaml")
FAMILIES = ("fetch", "ingest", "simulate")
CONFIG = {
    "cmd": [
        "python -m pedpred.config --check --stamp data/config.checked",
        "python -c 'from stages.code import write_code; write_code()'",
    ],
    "deps": ["conf", "params.yaml", "pedpred", "stages"],
    "outs": [{"data/config.checked": {"cache": False}}, {"data/code": {"cache": False}}],
}
"""What the first stage begins with; to make all settings takes 4 s longer, and `test_settings.py` does."""
NEEDED = {"conf", "pedpred", "stages", "dvc.yaml", "params.yaml", ".dvc", ".dvcignore", ".gitignore", ".git"}
QUICK = {"NUMBA_DISABLE_JIT": "1", "PEDPRED_JOBS": "1"}  # a second of simulation: no compilation

pytestmark = pytest.mark.slow


def run(folder, *command, succeeds=True):
    ended = done(folder, *command, **QUICK)
    assert (ended.returncode == 0) is succeeds, f"{command}\n{ended.stdout}\n{ended.stderr}"
    return ended.stdout + ended.stderr


@pytest.fixture(scope="module")
def mirror(tmp_path_factory):
    """The folder in which the copy of the project looks for raw files of ewap; it is empty."""
    return tmp_path_factory.mktemp("mirror")


@pytest.fixture(scope="module")
def project(mirror, tmp_path_factory):
    """A committed copy of the working tree in which the corridor lasts a second, reproduced.

    It has the families of stages that run here, and their files; DVC reads all stages several times in every
    command.
    """
    folder = tmp_path_factory.mktemp("pipeline") / "project"
    run(ROOT, ".ci/copy", str(folder))
    for path in folder.iterdir():
        if path.name not in NEEDED:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    stages = read("dvc.yaml")["stages"]
    chosen = {"config": CONFIG} | {name: stages[name] for name in FAMILIES}
    (folder / "dvc.yaml").write_text(yaml.safe_dump({"stages": chosen}))
    text = (folder / ROWS).read_text().replace("hours: 0.95", "hours: 0.0005")
    (folder / ROWS).write_text(text.replace("pedestrians: 10", "pedestrians: 3"))
    about = yaml.safe_load((folder / MIRRORS).read_text()) | {"folders": [str(mirror)], "archives": []}
    (folder / MIRRORS).write_text(yaml.safe_dump(about))
    run(folder, sys.executable, "-m", "pedpred.config")
    run(folder, "dvc", "repro", TARGET, "ingest@eth")
    run(folder, "git", "add", "--all")
    run(folder, "git", "commit", "--quiet", "--message", "reproduced")
    return folder


def test_second_clone_pulls_and_recomputes_nothing(project, tmp_path):
    remote, clone = tmp_path / "remote", tmp_path / "clone"
    run(project, "dvc", "remote", "add", "--default", "--local", "shelf", str(remote))
    run(project, "dvc", "push", TARGET)
    run(tmp_path, "git", "clone", "--quiet", str(project), str(clone))
    shutil.copy(project / ".dvc/config.local", clone / ".dvc")
    run(clone, "dvc", "pull", TARGET)
    assert (clone / TRACKS).read_bytes() == (project / TRACKS).read_bytes()
    assert "Running stage 'simulate" not in run(clone, "dvc", "repro", TARGET)
    for folder in (project, clone):
        assert run(folder, "git", "status", "--short") == ""


def test_missing_raw_files_are_looked_for_again(project, mirror):
    """`make reproduce` removes the notes; the run cache would bring them back."""
    raw = project / "data/raw/ewap"
    assert json.loads((project / "data/scenes/real/eth/scene.json").read_text())["unavailable"]
    shutil.rmtree(raw)
    (mirror / "seq_eth").mkdir()
    (mirror / "seq_eth/H.txt").write_text("altered")
    assert "H.txt has SHA-256" in run(project, "dvc", "repro", "ingest@eth", succeeds=False)
    assert not raw.exists()


def test_comment_in_the_code_simulates_nothing_again(project):
    original, said = (project / WALKING).read_text(), []
    for added in ("# a remark", "REMARK = 1"):
        (project / WALKING).write_text(f"{original}\n{added}\n")
        said.append(run(project, "dvc", "repro", TARGET))
    run(project, "git", "checkout", "--quiet", str(WALKING), "dvc.lock")
    assert all("Running stage 'config'" in text for text in said)
    assert ["Running stage 'simulate" in text for text in said] == [False, True]
