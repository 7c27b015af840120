"""Rebuild the long branches of the pipeline side by side: `python -m tools.branches`.

`make reproduce` starts with it. `dvc repro` runs one stage after the other, and a training uses one core: its
steps are too small to gain from a second one. The LSTMs and each of the networks without memory need nothing
of each other, so one `dvc repro` per branch trains them at once; DVC keeps two commands from the same files.
What fails is reported by the `dvc repro` that follows, which runs it again.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import IO

from omegaconf import DictConfig

from pedpred.config import read_params
from pedpred.errors import user_errors
from pedpred.files import write_text

SHARED = ("ingest", "simulate", "situations_simulated", "situations_real")
"""Stages that several branches need."""
LSTMS = ("finetune", "distil_encoder", "validate_simulation")
"""The last stages of the branch whose output is shown."""
LOGS = Path("build/branches")
_LOOK_S = 0.5


def memoryless(params: DictConfig) -> dict[str, list[str]]:
    """The last stages of the branch of each network without memory."""
    return {
        name: [f"train_robot@{name}", *(f"finetune_situations@{name}-{fold}" for fold in params.folds.real)]
        for name in params.methods.memoryless
    }


def reproduce(targets: Iterable[str], output: IO[str] | None = None) -> subprocess.Popen:
    """Start `dvc repro` of some stages; its output goes to a file or to the terminal."""
    command = ["dvc", "--wait-for-lock", "repro", "--keep-going", *targets]
    return subprocess.Popen(command, stdout=output, stderr=output)  # noqa: S603, a list, no shell


def follow(process: subprocess.Popen, log: Path) -> None:
    """Show what a process adds to its log until it ends."""
    with log.open() as text:
        text.seek(0, os.SEEK_END)
        running = True
        while running:
            running = process.poll() is None  # what it wrote before it ended is still to be shown
            sys.stdout.write(text.read())
            sys.stdout.flush()
            time.sleep(_LOOK_S * running)


@user_errors()
def main(arguments: list[str] | None = None) -> None:
    """Run what the branches share, then all branches."""
    argparse.ArgumentParser(prog="python -m tools.branches", description=__doc__).parse_args(arguments)
    branches = memoryless(read_params(Path()))
    with reproduce(SHARED):
        pass  # leaving waits for it
    sys.stdout.write(f"Side by side: the LSTMs, {', '.join(branches)} (their output is in {LOGS})\n")
    sys.stdout.flush()
    running: dict[Path, subprocess.Popen] = {}
    with ExitStack() as stack:
        for name, targets in branches.items():
            write_text(log := LOGS / f"{name}.log", "")
            running[log] = stack.enter_context(reproduce(targets, stack.enter_context(log.open("w"))))
        with reproduce(LSTMS):
            pass
        for log, process in running.items():
            follow(process, log)


if __name__ == "__main__":
    main()
