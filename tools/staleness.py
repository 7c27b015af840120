"""What a change makes stale, and a picture of the pipeline: `python -m tools.staleness [CHANGE ...]`.

A change is a key of params.yaml, such as `features.lstm.grid_cells`, or a file. Both answers come from the
pipeline's own graph, without running anything. `--write` puts the table into ARCHITECTURE.md and draws
docs/pipeline.png, as `make readme` does. `config` and `code` write what others depend on part by part.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import os
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import networkx as nx
from dvc.dependency import ParamsDependency
from dvc.dvcfile import load_file
from dvc.repo import Repo
from dvc.repo.index import Index
from dvc.scm import SCMError
from dvc.stage import Stage

from pedpred.config import SHARED, plain, read_params
from pedpred.errors import InputError, ValueRuleError, user_errors
from pedpred.files import write_text
from pedpred.report.canvas import write_png
from stages.code import CODE, ROOT, listings
from tools.arguments import in_project
from tools.pipeline_picture import draw_families
from tools.readme import filled

PAGE, PICTURE = Path("ARCHITECTURE.md"), Path("docs/pipeline.png")
FIRST = ("config", "code")
"""Stages that write a file per part of params.yaml and per script; others depend on some of these files."""
CHANGES = {
    "the LSTM's grid": "features.lstm.grid_cells",
    "the rays of Mixture": "features.mixture.beams",
    "a width of the LSTM": "methods.networks.lstm.settings.joint",
    "a width of Mixture": "methods.memoryless.mixture.settings.units",
    "steps of the LSTM's main training": "training.main.steps",
    "a threshold of the metrics": "evaluation.collision_m",
    "replicates of the bootstrap": "comparison.bootstrap",
    "a label or colour": "report.methods.lstm.label",
    "a recording's tracker": "trackers.tuned_on_eth.acceleration_noise",
    "code of a network": "pedpred/models/mixture/network.py",
    "code of the exports": "pedpred/models/export.py",
    "code of the pages": "pedpred/report/tables.py",
}
"""Row of the table -> its change."""


def pipeline(folder: Path) -> nx.DiGraph:
    """The stages, each with an edge to every one that it needs.

    Raises:
        InputError: there is no project, or DVC looks for a git history, and there is none.
    """
    in_project(folder)
    try:
        project = Repo(str(folder))
        file = load_file(project, f"{project.root_dir}/dvc.yaml")
        file.lockfile_contents = {}  # it says nothing of needs, and takes as long to parse as all the rest
        graph: nx.DiGraph = Index(project, stages=[*file.stages.values()]).graph
    except SCMError as error:
        raise InputError(folder, "", str(error), "`make setup` lets DVC do without") from error
    return graph


def family(name: str) -> str:
    """The name of a stage without its row: `ingest` of `ingest@eth`."""
    return name.partition("@")[0]


def reads(stage: Stage, change: str) -> bool:
    """Whether a stage depends on a key of params.yaml, on its part in a file, or on a file.

    A key or folder that holds what the stage depends on counts as well.
    """
    shared, path = str(SHARED / f"{change.partition('.')[0]}.yaml"), Path(os.path.relpath(change)).parts
    for dependency in stage.deps:
        if dependency.def_path == shared:
            return True
        if any(_overlap(path, file) for file in _files(dependency.def_path)):
            return True
        keys = dependency.params if isinstance(dependency, ParamsDependency) else ()
        if any(_overlap(change.split("."), key.split(".")) for key in keys):
            return True
    return False


@functools.cache
def _files(dependency: str) -> list[tuple[str, ...]]:
    """The paths, by their parts, that a dependency stands for: of a file of data/code, those listed in it."""
    path, methods = Path(dependency), _params(ROOT)["methods"]
    if not path.is_relative_to(CODE):
        return [path.parts]
    listed = (files for name, files in listings(methods).items() if name.is_relative_to(path))
    return [file.relative_to(ROOT).parts for file in itertools.chain(*listed)]


def _overlap(one: Sequence[str], other: Sequence[str]) -> bool:
    """Whether one of two keys or paths, by their parts, holds the other, or is it."""
    return all(own == others for own, others in zip(one, other, strict=False))


@functools.cache
def _params(folder: Path) -> dict[str, Any]:
    """Read params.yaml once for all changes."""
    return plain(read_params(folder))


def _is_key(change: str) -> bool:
    """Whether params.yaml has a key; its value may be nothing."""
    node: Any = _params(Path.cwd())
    for name in change.split("."):
        if not isinstance(node, dict) or name not in node:
            return False
        node = node[name]
    return True


def _in_conf(change: str) -> list[str]:
    """The parts of a path from conf/ on; none for other paths and for keys."""
    parts = Path(os.path.relpath(change)).parts
    return list(parts) if parts[:1] == ("conf",) else []


def _is_composed(change: str) -> bool:
    """Whether a path of conf/ reaches stages through keys of params.yaml, even if some read it as a file."""
    parts = _in_conf(change)
    return bool(parts) and (len(parts) == 1 or _is_key(parts[1]))


def stale(graph: nx.DiGraph, change: str) -> set[str]:
    """Names of the stages that a change makes stale.

    Raises:
        ValueRuleError: no stage reads what is changed, or it reaches stages through keys of params.yaml.
    """
    if not change or not (Path(change).exists() or _is_key(change)):
        raise ValueRuleError("change", change, "there is no such file or key of params.yaml")
    first = [stage for stage in graph if reads(stage, change) and stage.name not in FIRST]
    if _is_composed(change) or (not first and _in_conf(change)):
        rule = "params.yaml is composed of it: name the key that changes, such as features.lstm.grid_cells"
        raise ValueRuleError("change", change, rule)
    if not first:
        raise ValueRuleError(
            "change", change, "no stage reads it; a file, or a key of params.yaml, is needed"
        )
    changed = set(first).union(*(nx.ancestors(graph, stage) for stage in first))
    return {stage.name for stage in changed}


def staleness_table(graph: nx.DiGraph) -> str:
    """Markdown: a row per change, with the number of stages that it makes stale, by family."""
    lines = [f"| a change of | stale stages, of {len(graph)} | which |", "| --- | ---: | --- |"]
    sizes = Counter(family(stage.name) for stage in graph)
    for title, change in CHANGES.items():
        names = stale(graph, change)
        count = Counter(family(name) for name in names)
        parts = [
            kind if count[kind] == sizes[kind] else f"{kind} ({count[kind]} of {sizes[kind]})"
            for kind in count
        ]
        lines.append(f"| {title} (`{change}`) | {len(names)} | {', '.join(sorted(parts))} |")
    return "\n".join(lines)


def families(graph: nx.DiGraph) -> nx.DiGraph:
    """Families of stages but the first ones, each with an edge to those that read from it; no shortcuts."""
    joined = nx.quotient_graph(graph, lambda one, other: family(one.name) == family(other.name))
    named = nx.relabel_nodes(joined, {node: family(next(iter(node)).name) for node in joined})
    named.remove_nodes_from(FIRST)
    return nx.transitive_reduction(named).reverse()


def marked(graph: nx.DiGraph) -> dict[str, str]:
    """What stands between the marks of the page: name -> Markdown."""
    return {"stale": staleness_table(graph)}


def describe(graph: nx.DiGraph, change: str) -> Iterable[str]:
    """Lines about a change: how many stages of each family are stale."""
    names = stale(graph, change)
    yield f"{change}: {len(names)} of {len(graph)} stages"
    yield from (f"  {name}" for name in sorted(names))


@user_errors()
def main() -> None:
    """Print what some changes make stale; without any, the table."""
    parser = argparse.ArgumentParser(prog="python -m tools.staleness", description=__doc__.partition(":")[0])
    parser.add_argument("change", nargs="*", help="a key of params.yaml, or a file")
    parser.add_argument("--write", action="store_true", help=f"write {PICTURE} and the table of {PAGE}")
    args, graph = parser.parse_args(), pipeline(Path())
    for change in args.change:
        print("\n".join(describe(graph, change)))
    if args.write:
        write_text(PAGE, filled(PAGE.read_text(), marked(graph)))
        write_png(draw_families(families(graph)), PICTURE)
    elif not args.change:
        print(*marked(graph).values(), sep="\n\n")


if __name__ == "__main__":
    main()
