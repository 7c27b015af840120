"""`make trust`, second half: disturb the stages of a copy of the project at toy size.

After each fault, the same command must end with the bytes of an undisturbed run and leave no other files.
"""

import argparse
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from tqdm import tqdm

from tests.trust.project import ROOT, SILENT, Project, done, kinds, made, started, toy

FOLDER = ROOT / "build/trust/project"
KIRITIMATI = {"TZ": "Pacific/Kiritimati", "LC_ALL": "C", "PEDPRED_JOBS": "1", "PYTHONHASHSEED": "7"}


def processes(session: int) -> Iterator[tuple[int, bytes]]:
    """Yield pid and command of every living process of a session."""
    for entry in Path("/proc").glob("[0-9]*"):
        number = int(entry.name)
        try:
            if os.getsid(number) == session and (command := (entry / "cmdline").read_bytes()):
                yield number, command
        except (ProcessLookupError, FileNotFoundError):
            continue


def kill(run: subprocess.Popen) -> None:
    """Kill -9 a stage, the DVC process above it and all its workers."""
    while members := [number for number, _ in processes(run.pid)]:
        for number in members:
            try:
                os.kill(number, signal.SIGKILL)
            except ProcessLookupError:
                continue
    run.wait()  # until it is reaped, DVC takes its locks for held


# Faults of one stage: each disturbs a run of it and describes what it did


def killed(project: Project, stage: str, rng: np.random.Generator) -> str:
    """Kill -9 all its processes at a random moment."""
    after_s = rng.uniform(0.0, project.usual_s[stage])
    run = started(project.folder, stage)
    time.sleep(after_s)
    kill(run)
    return f"killed after {after_s:.1f} s of {project.usual_s[stage]:.1f} s"


def killed_half_trained(project: Project, stage: str, rng: np.random.Generator) -> str:
    """Kill -9 all processes after a training has saved its state; the next run must resume from it."""
    run, trainings = started(project.folder, stage), project.folder / "build/training"
    while run.poll() is None:
        if list(trainings.glob("*/progress.safetensors")):
            time.sleep(rng.uniform(0.0, 1.0))
            kill(run)
            return f"killed with {len(list(trainings.glob('*/progress.safetensors')))} saved state"
        time.sleep(0.01)
    return "it ended before a state was saved"


def without_a_worker(project: Project, stage: str, rng: np.random.Generator) -> str:
    """Kill -9 one joblib worker as soon as there is one."""
    run = started(project.folder, stage)
    while run.poll() is None:
        for number, command in processes(run.pid):
            if b"loky.backend.popen_loky" in command:
                os.kill(number, signal.SIGKILL)
                run.wait()
                return f"a worker killed, exit code {run.returncode}"
        time.sleep(0.02)
    return "it ended before a worker was found"


def raced(project: Project, stage: str, rng: np.random.Generator) -> str:
    """Run two `dvc repro` at once: one that fails must print the reason."""
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    runs = [started(project.folder, stage, **options)]
    time.sleep(rng.uniform(0.0, 0.5 * project.usual_s[stage]))
    runs.append(started(project.folder, stage, **options))
    said = [run.communicate()[0].strip() for run in runs]
    losers = [text for run, text in zip(runs, said, strict=True) if run.returncode]
    if any("ERROR:" not in text or "Traceback" in text for text in losers):
        raise AssertionError(f"the second run fails without a word: {losers}")
    return f"exit codes {[run.returncode for run in runs]}; {' '.join(losers)[-200:]}"


def on_a_full_disk(project: Project, stage: str, rng: np.random.Generator) -> str:
    """Simulate onto a disk with a few kB left; the stage must fail with a remedy."""
    (project.folder / "build/mounted").mkdir(parents=True, exist_ok=True)
    simulate = f"{sys.executable} -m stages.simulate +name=corridor +out=build/mounted/corridor"
    script = f"mount -t tmpfs -o size=8k tmpfs build/mounted && {simulate}"
    run = done(project.folder, "unshare", "--mount", "sh", "-c", script)
    if not run.returncode or "it cannot be written" not in run.stderr:
        raise AssertionError(f"exit code {run.returncode}: {run.stderr[-500:]}")
    return f"said: {run.stderr.strip().splitlines()[-1]}"


def may_mount() -> bool:
    """Whether this process may mount file systems."""
    command = ["unshare", "--mount", "true"]
    return bool(shutil.which("unshare")) and subprocess.run(command, check=False, **SILENT).returncode == 0


# Faults of all stages


def elsewhere(project: Project) -> str:
    """Run all in another folder with one worker, another time zone and locale; return the problem or ""."""
    other = project.folder.with_name("else where")
    toy(other)
    run = done(other, "dvc", "repro", **KIRITIMATI)
    problem = f"dvc repro fails: {run.stderr[-500:]}" if run.returncode else project.differing(other)
    if not problem:
        shutil.rmtree(other)
    return problem


Fault = Callable[[Project, str, np.random.Generator], str]


def plan(stages: Mapping[str, str], kills: int, mounts: bool, short: bool = False) -> list[tuple[Fault, str]]:
    """List all faults (or only kills) with their stages; `stages` maps names to commands."""
    scripts = {name: ROOT / f"{line.split()[2].replace('.', '/')}.py" for name, line in stages.items()}
    parallel = [stage for stage, script in scripts.items() if "pedpred.workers" in script.read_text()]
    trained = [stage for stage, script in scripts.items() if script.stem == "train"]
    faults: list[tuple[Fault, Sequence[str]]] = [
        (killed, kills * [*stages]),
        (killed_half_trained, kills * trained),
    ]
    if not short:
        faults += [(without_a_worker, parallel), (raced, [*parallel[:1], *trained[:1]])]
        faults += [(on_a_full_disk, parallel[:1])] if mounts else []
    return [(fault, stage) for fault, chosen in faults for stage in chosen]


def tried(fault: Fault, project: Project, stage: str, rng: np.random.Generator) -> tuple[str, str]:
    """Disturb a stage, then reproduce: what was done, and the problem afterwards or ""."""
    try:
        return fault(project, stage, rng), project.mended()
    except AssertionError as failure:
        return "failed", str(failure) or "it failed"


def main() -> None:
    """Reproduce a copy, disturb it repeatedly, and print the results."""
    parser = argparse.ArgumentParser(prog="python -m tests.trust.faults", description=__doc__)
    parser.add_argument("--kills", type=int, default=2, help="of each kind of stage")
    parser.add_argument("--stages", nargs="+", help="only these of them, e.g. embed@real")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--short", action="store_true", help="only kills")
    given = parser.parse_args()
    project = made(FOLDER)
    chosen = {s: project.stages[s] for s in given.stages or kinds(project.stages)}
    project = project.timed(chosen)
    rng = np.random.default_rng(given.seed)
    outcomes: dict[str, list[bool]] = {}
    mounts = may_mount()
    if not (mounts or given.short):
        tqdm.write("a full disk is not tried: mounting is not permitted here")
    for fault, stage in tqdm(plan(chosen, given.kills, mounts, given.short), desc="faults", unit="fault"):
        did, problem = tried(fault, project, stage, rng)
        name = f"{stage.split('@')[0]} {fault.__name__.replace('_', ' ')}"
        tqdm.write(f"{name}: {did}; {problem or 'the same bytes'}")
        outcomes.setdefault(name, []).append(not problem)
    if not given.short:
        outcomes["all stages elsewhere"] = [not (problem := elsewhere(project))]
        tqdm.write(f"all stages elsewhere: {problem or 'the same bytes'}")
    rows = [f"| {name} | {len(own)} | {sum(own)} |" for name, own in outcomes.items()]
    head = ["| fault | attempts | the same bytes afterwards |", "| --- | --: | --: |"]
    print(*head, *rows, sep="\n")
    sys.exit(not all(map(all, outcomes.values())))


if __name__ == "__main__":
    main()
