"""The pipeline in a copy of the project: sweeps differ, a remote shares results, nothing goes stale."""

import hashlib
import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from tests.configuration import read
from tests.trust.project import ROOT, SILENT, done, environment

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
BY_HAND = """
import runpy
import sys

out, *numbers = sys.argv[1:]
for people in numbers:
    sys.argv[1:] = ["+name=corridor", f"simulations.corridor.pedestrians={people}", f"+out={out}/{people}"]
    runpy.run_module("stages.simulate", run_name="__main__", alter_sys=True)
"""
QUICK = {"NUMBA_DISABLE_JIT": "1", "PEDPRED_JOBS": "1"}  # a second of simulation: no compilation

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("sweep")]


def run(folder, *command, succeeds=True):
    ended = done(folder, *command, **QUICK)
    assert (ended.returncode == 0) is succeeds, f"{command}\n{ended.stdout}\n{ended.stderr}"
    return ended.stdout + ended.stderr


def finished_experiments(folder, count, patience_s=300):
    """The git references of a queue's experiments, once they are all there."""
    deadline = time.monotonic() + patience_s
    while time.monotonic() < deadline:
        references = run(folder, "git", "for-each-ref", "--format=%(refname)", "refs/exps").split()
        ended = [reference for reference in references if reference.split("/")[2] not in ("celery", "exec")]
        if len(ended) == count:
            return ended
        if "refs/exps/celery/failed" in references:
            break
        time.sleep(0.5)
    pytest.fail(f"{count} experiments should have finished:\n{run(folder, 'dvc', 'queue', 'status')}")


def tracks_md5(folder, revision):
    """The checksum of the simulated tracks as a revision's dvc.lock and the cache record it."""
    lock = yaml.safe_load(run(folder, "git", "show", f"{revision}:dvc.lock"))
    listing = lock["stages"][TARGET]["outs"][0]["md5"]
    files = json.loads((folder / ".dvc/cache/files/md5" / listing[:2] / listing[2:]).read_text())
    return next(file["md5"] for file in files if Path(file["relpath"]).name == TRACKS.name)


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


@pytest.fixture(scope="module")
def sweep(project, tmp_path_factory):
    """Another copy of it, in which two points of a sweep are queued; they run while the other tests do."""
    folder = tmp_path_factory.mktemp("sweep") / "project"
    shutil.copytree(project, folder, symlinks=True)
    run(folder, "dvc", "exp", "run", "--queue", "-S", "simulations.corridor.pedestrians=2,4", TARGET)
    start = ["dvc", "queue", "start", "--jobs", "2"]  # its workers would keep pipes open
    subprocess.run(start, cwd=folder, env=environment(**QUICK), check=True, **SILENT)
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


def test_edit_under_conf_without_make_params_is_not_ignored(project):
    original = (project / ROWS).read_text()
    try:
        (project / ROWS).write_text(original.replace("pedestrians: 3", "pedestrians: 4"))
        said = run(project, "dvc", "repro", TARGET, succeeds=False)
    finally:
        (project / ROWS).write_text(original)
    assert "-    pedestrians: 3\n+    pedestrians: 4" in said


def test_comment_in_the_code_simulates_nothing_again(project):
    original = (project / WALKING).read_text()
    said = []
    try:
        for added in ("# a remark", "REMARK = 1"):
            (project / WALKING).write_text(f"{original}\n{added}\n")
            said.append(run(project, "dvc", "repro", TARGET))
    finally:
        (project / WALKING).write_text(original)
        run(project, "git", "checkout", "--quiet", "dvc.lock")
    assert all("Running stage 'config'" in text for text in said)
    assert ["Running stage 'simulate" in text for text in said] == [False, True]


def test_points_of_a_queued_sweep_are_what_a_stage_by_hand_makes(project, sweep, tmp_path):
    run(project, sys.executable, "-c", BY_HAND, str(tmp_path), "2", "4")
    files = {people: tmp_path / str(people) / "corridor" / TRACKS.name for people in (2, 4)}
    by_hand = {people: hashlib.md5(file.read_bytes()).hexdigest() for people, file in files.items()}
    swept = {}
    for point in finished_experiments(sweep, 2):
        params = yaml.safe_load(run(sweep, "git", "show", f"{point}:params.yaml"))
        swept[params["simulations"]["corridor"]["pedestrians"]] = tracks_md5(sweep, point)
    assert swept == by_hand
    assert len(set(swept.values())) == 2
