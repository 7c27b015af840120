"""Rebuild the long branches of the pipeline side by side: `python -m tools.branches`.

`make reproduce` starts with it. `dvc repro` runs one stage after the other, and a training uses one core. The
LSTMs, the networks of the literature and each network without memory need nothing further of each other, so
one `dvc repro` per branch trains and evaluates them at once. Each names its own stages only: DVC refuses a
stage, even an unchanged one, while another command looks at it. What fails is reported by the `dvc repro`
that follows, which runs it again.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterable
from pathlib import Path

import networkx as nx
from omegaconf import DictConfig

from pedpred.config import read_params
from pedpred.errors import user_errors
from tools.arguments import no_arguments
from tools.programs import beside_python
from tools.staleness import pipeline

SHARED = ("ingest", "simulate", "situations_simulated", "situations_real", "pretrain_autoencoder")
"""Stages that several branches need."""


def branches(params: DictConfig) -> dict[str, list[str]]:
    """The last stages of each branch: LSTMs and simple methods, the literature, each Mixture."""
    lstms = ["evaluate_main", "evaluate_fold", "evaluate_baseline", "validate_simulation"]
    others = {
        name: [
            f"train_robot@{name}",
            f"evaluate_main_situations@{name}",
            *(f"evaluate_fold_situations@{name}-{fold}" for fold in params.folds.real),
        ]
        for name in params.methods.memoryless
    }
    return {"lstms": lstms, "literature": ["evaluate_literature"]} | others


def stage_names(folder: Path) -> nx.DiGraph:
    """Names of the stages, each with an edge to every one that it needs."""
    return nx.relabel_nodes(pipeline(folder), lambda stage: stage.name)


def needed(graph: nx.DiGraph, targets: Iterable[str]) -> list[str]:
    """Stages, or all of a kind, and those that they need, in the order in which they can run."""
    wanted = [name for name in graph if {name, name.partition("@")[0]} & set(targets)]
    required = set(wanted).union(*(nx.descendants(graph, name) for name in wanted))
    return [name for name in reversed(list(nx.topological_sort(graph))) if name in required]


@user_errors()
def main() -> None:
    """Run what the branches share, then all branches; lines of their output alternate."""
    graph = stage_names(Path())
    command = ["dvc", "--wait-for-lock", "repro", "--keep-going", "--single-item"]
    shared = needed(graph, SHARED)
    subprocess.run([*command, *shared], check=False, env=beside_python())
    running = []
    for last in branches(read_params(Path())).values():
        stages = [stage for stage in needed(graph, last) if stage not in shared]
        running.append(subprocess.Popen([*command, *stages], env=beside_python()))
    for branch in running:
        branch.wait()


if __name__ == "__main__":
    no_arguments("tools.branches", __doc__)
    main()
