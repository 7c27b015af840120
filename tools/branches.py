"""Rebuild the long branches of the pipeline side by side: `python -m tools.branches`.

`make reproduce` starts with it. `dvc repro` runs one stage after the other, and a training uses one core: its
steps are too small to gain from a second one. The LSTMs and each of the networks without memory need nothing
of each other, so one `dvc repro` per branch trains them at once; DVC keeps two commands from the same files.
What fails is reported by the `dvc repro` that follows, which runs it again.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
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


@user_errors()
def main(arguments: list[str] | None = None) -> None:
    """Run what the branches share, then all branches."""
    argparse.ArgumentParser(prog="python -m tools.branches", description=__doc__).parse_args(arguments)
    branches = memoryless(read_params(Path()))
    with reproduce(SHARED):
        pass  # leaving waits for it
    sys.stdout.write(f"Side by side: the LSTMs, {', '.join(branches)} (their output is in {LOGS})\n")
    sys.stdout.flush()
    with ExitStack() as running:
        for name, targets in branches.items():
            write_text(LOGS / f"{name}.log", "")
            log = running.enter_context((LOGS / f"{name}.log").open("w"))
            running.enter_context(reproduce(targets, log))
        running.enter_context(reproduce(LSTMS))


if __name__ == "__main__":
    main()
