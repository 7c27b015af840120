"""A copy of the project at toy size, reproduced undisturbed: the reference for faults."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import networkx as nx
from dvc.repo import Repo
from tqdm import tqdm

from tests.plain_git import PLAIN_GIT

ROOT = Path(__file__).resolve().parents[2]
SILENT = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
# short trainings that save their state often
TOY = """\
autoencoder: {steps: 24, validate_every: 6, validation_crops: 100}
training:
  corridor: {steps: 40, validate_every: 5, lanes: 8}
  main: {steps: 40, validate_every: 5, lanes: 8}
  finetune: {steps: 24, validate_every: 3}
"""


@dataclass(frozen=True)
class Project:
    """A reproduced copy of the project."""

    folder: Path
    stages: dict[str, str]  # the command of every stage by its name, in the order in which they run
    expected: dict[str, str]  # checksum of every file of the results
    usual_s: dict[str, float] = field(default_factory=dict)  # undisturbed durations of stages, with DVC

    def timed(self, stages: Iterable[str]) -> Project:
        """Measure the undisturbed durations of some stages; exit if this second run gives other bytes."""
        usual_s = {}
        for stage in tqdm(stages, desc="undisturbed", unit="stage"):
            begun = time.monotonic()
            started(self.folder, stage).wait()
            usual_s[stage] = time.monotonic() - begun
        if problem := self.differing(self.folder):
            sys.exit(f"undisturbed, a second run gives {problem}")
        return replace(self, usual_s=usual_s)

    def mended(self) -> str:
        """Reproduce all as `make reproduce` does; return the problem or ""."""
        done(self.folder, sys.executable, "-m", "tools.mend_lock").check_returncode()
        run = done(self.folder, "dvc", "repro", "--no-run-cache")
        return f"dvc repro fails: {run.stderr[-500:]}" if run.returncode else self.differing(self.folder)

    def differing(self, folder: Path) -> str:
        """Name the results in a folder that differ from the expected ones; "" if none."""
        now = results(folder)
        names = sorted(k for k in now.keys() | self.expected.keys() if now.get(k) != self.expected.get(k))
        return f"other bytes in {', '.join(names[:3])} ({len(names)} in all)" if names else ""


def environment() -> dict[str, str]:
    """The environment of every command: this interpreter's tools first, no variables of outer DVC or git."""
    outer = {k: v for k, v in os.environ.items() if not k.startswith(("DVC_", "GIT_"))}
    tools = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    roles = ("AUTHOR", "COMMITTER")
    who = {f"GIT_{role}_{key}": "trust@localhost" for role in roles for key in ("NAME", "EMAIL")}
    calm = {"PEDPRED_JOBS": "2", "OMP_WAIT_POLICY": "passive"}  # else threads wait busily
    return outer | who | PLAIN_GIT | calm | {"PATH": tools, "DVC_ROOT": str(ROOT)}


def done(folder: Path, *command: str, **more: str) -> subprocess.CompletedProcess[str]:
    """Run a command to its end; `more` adds to its environment."""
    env = environment() | more
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)


def started(folder: Path, stage: str, **options: Any) -> subprocess.Popen:
    """Start a stage with --force, in a session of its own."""
    command = ["dvc", "repro", "--force", "--no-run-cache", "--single-item", stage]
    chosen = {"env": environment()} | SILENT | options
    return subprocess.Popen(command, cwd=folder, start_new_session=True, **chosen)


def results(folder: Path) -> dict[str, str]:
    """Compute the checksum of every file that the pipeline has written, by path.

    Temporary files of killed writers stay for a day, and do not count.
    """
    files = [p for top in ("data", "models", "reports") for p in (folder / top).rglob("*") if p.is_file()]
    files = [p for p in files if not (p.name.startswith(".") and ".tmp" in p.suffixes)]
    files.append(folder / "dvc.lock")
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def toy(folder: Path) -> None:
    """Copy the project, without results, at toy size."""
    shutil.rmtree(folder, ignore_errors=True)
    done(ROOT, ".ci/copy", str(folder)).check_returncode()
    (folder / "dvc.lock").unlink(missing_ok=True)
    text = (folder / "conf/config.yaml").read_text()
    (folder / "conf/config.yaml").write_text(text.replace("- scale: default", "- scale: toy"))
    smoke = (folder / "conf/scale/smoke.yaml").read_text()
    scenes = smoke[: smoke.index("autoencoder:")] + smoke[smoke.index("validation:") :]
    (folder / "conf/scale/toy.yaml").write_text(scenes + TOY)
    done(folder, sys.executable, "-m", "pedpred.config").check_returncode()


def pipeline(folder: Path) -> dict[str, str]:
    """The command of every stage of the main pipeline by name, in the order in which they run."""
    graph = Repo(str(folder)).index.graph  # from a stage to what it needs
    order = reversed(list(nx.lexicographical_topological_sort(graph, key=lambda stage: stage.addressing)))
    return {stage.name: stage.cmd for stage in order if Path(stage.path) == folder / "dvc.yaml"}


def kinds(stages: Mapping[str, str]) -> dict[str, str]:
    """One stage of each kind: of `rows@...` the first by name."""
    first = {name.split("@")[0]: name for name in sorted(stages, reverse=True)}
    return {name: command for name, command in stages.items() if name in first.values()}


def made(folder: Path) -> Project:
    """Copy the project and reproduce it at toy size; exit if that fails undisturbed."""
    toy(folder)
    project = Project(folder, pipeline(folder), {})
    run = done(folder, "dvc", "repro")
    if run.returncode:
        sys.exit(f"the pipeline fails undisturbed:\n{run.stdout[-2000:]}\n{run.stderr}")
    return replace(project, expected=results(folder))
