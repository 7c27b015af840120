"""`make trust`, second half: stages are killed, starved and raced in a copy of the project at toy size.

After each fault the same command must end in the bytes of an undisturbed run, with nothing left beside them.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

ROOT = Path(__file__).resolve().parents[2]
STAGES = (
    *("config", "simulate@corridor", "features@corridor", "pretrain_autoencoder", "encode@corridor"),
    *("train_corridor@lstm", "train_main@lstm", "evaluate_sim", "validate_simulation", "report_sim"),
    *("record_sim@office", "export@main"),
)
"""One stage of each kind of script that needs no raw data."""

_SILENT = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}


@dataclass(frozen=True)
class Project:
    """A reproduced copy of the project.

    Attributes:
        folder: where it is.
        usual_s: how long each stage takes undisturbed, DVC included, s.
        expected: checksum of every file of its results.
    """

    folder: Path
    usual_s: dict[str, float]
    expected: dict[str, str]

    def mended(self, stage: str) -> str:
        """Reproduce a stage; what is wrong afterwards, empty if nothing."""
        done = dvc(self.folder, "repro", "--no-run-cache", stage)
        if done.returncode:
            return f"dvc repro fails: {done.stderr[-300:]}"
        now = results(self.folder)
        changed = sorted(k for k in now.keys() | self.expected.keys() if now.get(k) != self.expected.get(k))
        return f"other bytes in {', '.join(changed[:3])}" if changed else ""


def environment() -> dict[str, str]:
    """Of every command: this interpreter's tools first, nothing of an outer DVC or git."""
    outer = {k: v for k, v in os.environ.items() if not k.startswith(("DVC_", "GIT_"))}
    tools = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    roles = ("AUTHOR", "COMMITTER")
    who = {f"GIT_{role}_{key}": "trust@localhost" for role in roles for key in ("NAME", "EMAIL")}
    return outer | who | {"PATH": tools, "PEDPRED_JOBS": "2", "DVC_ROOT": str(ROOT)}


def dvc(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run DVC to its end."""
    return subprocess.run(
        ["dvc", *arguments], cwd=folder, env=environment(), capture_output=True, text=True, check=False
    )


def started(folder: Path, stage: str, **options: object) -> subprocess.Popen:
    """Begin a stage anew, in a process group of its own."""
    command = ["dvc", "repro", "--force", "--no-run-cache", "--single-item", stage]
    return subprocess.Popen(
        command, cwd=folder, env=environment(), start_new_session=True, **{**_SILENT, **options}
    )


def results(folder: Path) -> dict[str, str]:
    """Checksum of every file that the pipeline has written, by its path."""
    files = [p for top in ("data", "models", "reports") for p in (folder / top).rglob("*") if p.is_file()]
    return {
        str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in [*files, folder / "dvc.lock"]
    }


def undisturbed(folder: Path, stages: list[str]) -> Project:
    """Copy the project, reproduce the stages at toy size, and note what an undisturbed run gives."""
    shutil.rmtree(folder, ignore_errors=True)
    subprocess.run([".ci/copy", str(folder)], cwd=ROOT, env=environment(), check=True)
    shutil.rmtree(folder / "reports", ignore_errors=True)
    (folder / "dvc.lock").unlink(missing_ok=True)
    text = (folder / "conf/config.yaml").read_text()
    (folder / "conf/config.yaml").write_text(text.replace("- scale: default", "- scale: smoke"))
    subprocess.run([sys.executable, "-m", "pedpred.config"], cwd=folder, env=environment(), check=True)
    usual_s = {}
    for stage in tqdm(stages, desc="undisturbed", unit="stage"):
        done = dvc(folder, "repro", stage)
        if done.returncode:
            sys.exit(f"{stage} fails undisturbed:\n{done.stdout}\n{done.stderr}")
        begun = time.monotonic()
        started(folder, stage).wait()
        usual_s[stage] = time.monotonic() - begun
    return Project(folder, usual_s, results(folder))


# Faults: each disturbs one run of a stage and returns what it did


def killed(project: Project, stage: str, rng: np.random.Generator) -> str:
    """kill -9 of the stage with all its workers, at a random moment."""
    after_s = rng.uniform(0.0, project.usual_s[stage])
    run = started(project.folder, stage)
    time.sleep(after_s)
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    return f"killed after {after_s:.1f} s"


def without_a_worker(project: Project, stage: str, rng: np.random.Generator) -> str:
    """kill -9 of one worker process of joblib's, as soon as there is one."""
    run = started(project.folder, stage)
    while run.poll() is None:
        for process in Path("/proc").glob("[0-9]*"):
            try:
                same = os.getsid(int(process.name)) == run.pid
                if same and b"loky.backend.popen_loky" in (process / "cmdline").read_bytes():
                    os.kill(int(process.name), signal.SIGKILL)
                    run.wait()
                    return f"a worker killed, exit code {run.returncode}"
            except (ProcessLookupError, FileNotFoundError):
                continue
        time.sleep(0.02)
    return "it ended before a worker was found"


def on_a_full_disk(project: Project, stage: str, rng: np.random.Generator) -> str:
    """A few kB are all that is left."""
    return _mounted(project, "size=8k")


def in_a_locked_folder(project: Project, stage: str, rng: np.random.Generator) -> str:
    """Nothing may be written where the result belongs."""
    return _mounted(project, "ro")


def _mounted(project: Project, options: str) -> str:
    """Simulate into a file system of its own; the stage must fail and say in words what to do."""
    (project.folder / "build/mounted").mkdir(parents=True, exist_ok=True)
    simulate = f"{sys.executable} -m stages.simulate +name=corridor +out=build/mounted/corridor"
    script = f"mount -t tmpfs -o {options} tmpfs build/mounted && {simulate}"
    command = ["unshare", "--mount", "sh", "-c", script]
    run = subprocess.run(
        command, cwd=project.folder, env=environment(), capture_output=True, text=True, check=False
    )
    if not run.returncode or "run dvc repro again" not in run.stderr:
        raise AssertionError(f"exit code {run.returncode}: {run.stderr[-500:]}")
    return f"said: {run.stderr.strip().splitlines()[-1]}"


def may_mount() -> bool:
    """Whether file systems can be mounted here, which takes rights that not everybody has."""
    command = ["unshare", "--mount", "true"]
    return bool(shutil.which("unshare")) and subprocess.run(command, check=False, **_SILENT).returncode == 0


def raced(project: Project, stage: str, rng: np.random.Generator) -> str:
    """Two `dvc repro` of the same stage at once."""
    runs = [started(project.folder, stage)]
    time.sleep(rng.uniform(0.0, 0.5 * project.usual_s[stage]))
    runs.append(started(project.folder, stage))
    return f"exit codes {[run.wait() for run in runs]}"


def elsewhere(project: Project, stage: str, rng: np.random.Generator) -> str:
    """One worker, another time zone, another language; the result is not thrown away."""
    other = {
        "TZ": "Pacific/Kiritimati",
        "LC_ALL": "C",
        "LANG": "C",
        "PEDPRED_JOBS": "1",
        "PYTHONHASHSEED": "7",
    }
    run = started(project.folder, stage, env=environment() | other)
    return f"one worker in Kiritimati, exit code {run.wait()}"


PARALLEL = ("simulate@corridor", "features@corridor", "encode@corridor")
Fault = Callable[[Project, str, np.random.Generator], str]


def plan(stages: list[str], kills: int, mounts: bool) -> list[tuple[Fault, str]]:
    """Every fault with the stage that it befalls."""
    parallel = [stage for stage in stages if stage in PARALLEL]
    return [
        *((killed, stage) for stage in stages for _ in range(kills)),
        *((without_a_worker, stage) for stage in parallel),
        *((raced, stage) for stage in parallel[:1]),
        *((fault, parallel[0]) for fault in (on_a_full_disk, in_a_locked_folder) if parallel and mounts),
        *((elsewhere, stage) for stage in stages),
    ]


def main() -> None:
    """Reproduce a copy, disturb it again and again, and print what survived."""
    parser = argparse.ArgumentParser(prog="python -m tests.trust.faults", description=__doc__)
    parser.add_argument("--kills", type=int, default=3, help="of each stage")
    parser.add_argument("--stages", nargs="+", default=list(STAGES))
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    project = undisturbed(ROOT / "build/trust/project", given.stages)
    rng = np.random.default_rng(given.seed)
    counts: dict[str, list[int]] = {}
    mounts = may_mount()
    if not mounts:
        tqdm.write("a full disk and a locked folder are not tried: mounting is not permitted here")
    for fault, stage in tqdm(plan(given.stages, given.kills, mounts), desc="faults", unit="fault"):
        did = fault(project, stage, rng)
        problem = project.mended(stage)
        attempts = counts.setdefault(f"{stage} {fault.__name__.replace('_', ' ')}", [0, 0])
        attempts[0] += 1
        attempts[1] += bool(problem)
        tqdm.write(f"{stage}: {did}; {problem or 'mended'}")
    lines = [f"| {name} | {n} | {n - lost} | {lost} |" for name, (n, lost) in counts.items()]
    head = "| fault | attempts | the same bytes afterwards | lost |\n| --- | --: | --: | --: |\n"
    sys.stdout.write(f"\n{head}{chr(10).join(lines)}\n")
    sys.exit(any(lost for _, lost in counts.values()))


if __name__ == "__main__":
    main()
