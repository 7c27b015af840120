"""Rebuild the long branches of the pipeline side by side: `python -m tools.branches`.

`make reproduce` starts with it. `dvc repro` runs one stage after the other, and a training uses one core: its
steps are too small to gain from a second one. The LSTMs and each of the networks without memory need nothing
of each other, so one `dvc repro` per branch trains them at once. Each names its own stages only: DVC refuses
a stage, even an unchanged one, while another command looks at it. What fails is reported by the `dvc repro`
that follows, which runs it again.
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

import networkx as nx
from dvc.repo import Repo
from dvc.scm import SCMError
from omegaconf import DictConfig

from pedpred.config import read_params
from pedpred.errors import FileError, user_errors
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


def pipeline(folder: Path) -> nx.DiGraph:
    """Names of the stages, each with an edge to every one that it needs.

    Raises:
        FileError: DVC looks for a git history, and there is none.
    """
    try:
        graph = Repo(str(folder)).index.graph
    except SCMError as error:
        raise FileError(folder, "", str(error), "`make setup` lets DVC do without") from error
    return nx.relabel_nodes(graph, {stage: stage.name for stage in graph})


def needed(graph: nx.DiGraph, targets: Iterable[str]) -> list[str]:
    """Stages, or all of a kind, and those that they need, in the order in which they can run."""
    wanted = [name for name in graph if {name, name.partition("@")[0]} & set(targets)]
    found = set(wanted).union(*(nx.descendants(graph, name) for name in wanted))
    return [name for name in reversed(list(nx.topological_sort(graph))) if name in found]


def reproduce(stages: Iterable[str], output: IO[str] | None = None) -> subprocess.Popen:
    """Start `dvc repro` of some stages, in this order; its output goes to a file or to the terminal."""
    command = ["dvc", "--wait-for-lock", "repro", "--keep-going", "--single-item", *stages]
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
    graph, branches = pipeline(Path()), memoryless(read_params(Path()))
    shared = needed(graph, SHARED)

    def own(targets: Iterable[str]) -> list[str]:
        return [name for name in needed(graph, targets) if name not in shared]

    with reproduce(shared):
        pass  # leaving waits for it
    sys.stdout.write(f"Side by side: the LSTMs, {', '.join(branches)} (their output is in {LOGS})\n")
    sys.stdout.flush()
    running: dict[Path, subprocess.Popen] = {}
    with ExitStack() as stack:
        for name, targets in branches.items():
            write_text(log := LOGS / f"{name}.log", "")
            running[log] = stack.enter_context(reproduce(own(targets), stack.enter_context(log.open("w"))))
        with reproduce(own(LSTMS)):
            pass
        for log, process in running.items():
            follow(process, log)


if __name__ == "__main__":
    main()
