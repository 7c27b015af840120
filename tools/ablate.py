"""Run an ablation of conf/ablations as DVC experiments: `python -m tools.ablate layouts [--jobs 2]`.

By hand, after `dvc repro`; the figures go to reports/ablations/<name>.{json,md,png}. Points are queued and
run in copies of their own; what has been computed before comes from DVC's cache, so an interrupted ablation
goes on where it was.
"""

from __future__ import annotations

import argparse
import itertools
import json
import logging
import re
import subprocess
import time
from collections.abc import Collection, Mapping
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
from dvc.repo import Repo
from dvc.scm import SCMError
from tqdm import tqdm

from pedpred.config import composed, config_errors, one_of, read_params
from pedpred.errors import ConfigError
from pedpred.files import check_output, write_json, write_text
from pedpred.metrics.table import METRICS
from pedpred.plain import parse_yaml
from pedpred.report.ablation import (
    Ablation,
    Column,
    ablation_figure,
    ablation_table,
    point_rows,
    read_ablation,
    steps_table,
    steps_until,
)
from pedpred.report.canvas import write_png
from pedpred.report.methods import Methods
from stages.config import check_parts
from tools.arguments import count, in_project
from tools.programs import beside_python

if TYPE_CHECKING:
    from dvc.repo.experiments.queue.celery import LocalCeleryQueue

PATIENCE_S = 2.0  # between two looks at the queue
_FIGURES = [*METRICS, *(f"{key}_minus_reference" for key in METRICS), "windows", "eligible", "tracks"]
_NUMBER = re.compile(r"(?=.*[1-9])\d*\.?\d+")
_LOOKS = 30  # until workers are started again, in case that one has died: DVC starts only missing ones


def output_of(*command: str) -> str:
    """Run a command and return its output.

    Raises:
        SystemExit: it failed; with its output.
    """
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=beside_python())
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}\n{done.stdout}\n{done.stderr}")
    return done.stdout


def finished_experiments() -> dict[str, str]:
    """Git references of all finished experiments by name; `failed` is there once one has failed."""
    references = output_of("git", "for-each-ref", "--format=%(refname)", "refs/exps").split()
    return {reference.rpartition("/")[2]: reference for reference in references}


def open_project() -> Repo:
    """Open the project with DVC.

    Raises:
        SystemExit: there is no git repository, without which DVC has no queue.
    """
    try:
        return Repo()
    except SCMError as error:
        raise SystemExit(str(error)) from error


def leave_queue(names: Collection[str]) -> None:
    """End what an interrupted call left in the queue: under the same name, it may have had other settings.

    Stages that have ended come from DVC's cache.
    """
    with open_project() as project:
        queue = project.experiments.celery_queue
        queue.clear(failed=True)
        for status, command in (("Queued", "remove"), ("Running", "kill")):
            if tasks := _tasks(queue, names, status):
                output_of("dvc", "queue", command, *tasks)
        while _tasks(queue, names, "Running"):
            time.sleep(PATIENCE_S)
        queue.clear(failed=True)


def _tasks(queue: LocalCeleryQueue, names: Collection[str], status: str) -> list[str]:
    """Revisions of the queue's tasks with some names that have a status."""
    return [task["rev"] for task in queue.status() if task["status"] == status and task["name"] in names]


def run_points(ablation: Ablation, experiments: Mapping[str, str], jobs: int) -> dict[str, str]:
    """Run every point as a queued DVC experiment; their git references by point."""
    leave_queue(experiments.values())
    if stale := sorted(set(experiments.values()) & set(finished_experiments())):
        output_of("dvc", "exp", "remove", *stale)
    for point, name in experiments.items():
        overrides = [f"--set-param={o}" for o in (*ablation.always, *ablation.points[point])]
        output_of("dvc", "exp", "run", "--queue", "--name", name, *overrides, *ablation.targets)
    start, quiet = ["dvc", "queue", "start", "--jobs", str(jobs)], subprocess.DEVNULL
    done: dict[str, str] = {}
    with tqdm(total=len(experiments), unit="point") as bar:
        for look in itertools.count():
            if bar.n == len(experiments):
                break
            if look % _LOOKS == 0:  # workers would keep pipes open
                subprocess.run(start, check=True, stdout=quiet, stderr=quiet, env=beside_python())
            time.sleep(PATIENCE_S)
            done = finished_experiments()
            if "failed" in done:
                raise SystemExit("A point failed: `dvc queue status` says which, `dvc queue logs <name>` why")
            bar.update(len(set(experiments.values()) & set(done)) - bar.n)
    return {point: done[name] for point, name in experiments.items()}


def metrics_of_points(ablation: Ablation, references: Mapping[str, str]) -> dict[str, dict]:
    """The metric files that the ablation reads: point -> file -> contents."""
    files = {column.metrics for column in _columns(ablation)}
    return {
        point: {file: json.loads(output_of("git", "show", f"{reference}:{file}")) for file in sorted(files)}
        for point, reference in references.items()
    }


def training_curves(ablation: Ablation, references: Mapping[str, str]) -> dict[str, dict[str, pd.DataFrame]]:
    """The training curves asked for: point -> method -> curve."""

    def curve(reference: str, path: str) -> pd.DataFrame:
        return pd.read_csv(StringIO(output_of("git", "show", f"{reference}:{path}")), sep="\t")

    return {
        point: {method: curve(reference, path) for method, path in ablation.curves.items()}
        for point, reference in references.items()
    }


def check_points(ablation: Ablation, conf: Path) -> None:
    """Compose each point and look up what is shown, before any of them runs.

    Raises:
        ConfigError, ValueRuleError: an override names no key or breaks a rule, a method or figure is unknown,
            or the name of a point on an axis is no number.
    """
    for column in _columns(ablation):
        one_of("columns", column.figure, dict.fromkeys(_FIGURES))
    shown = {*ablation.methods, *ablation.references, *ablation.curves}
    shown |= {column.over for column in ablation.columns.values() if column.over}
    for name, overrides in ablation.points.items():
        if ablation.axis and not _NUMBER.fullmatch(name):
            raise ConfigError("points", name, "it must be a positive number, since there is an axis")
        point = parse_yaml(composed(conf, [*ablation.always, *overrides]))
        check_parts(point)
        known = {key: row for rows in point["methods"].values() for key, row in rows.items()}
        for method in sorted(shown):
            one_of("methods", method, known)


def _columns(ablation: Ablation) -> list[Column]:
    """The main figure of an ablation, and its further ones."""
    return [Column(ablation.metrics, ablation.entry), *ablation.columns.values()]


def check_measured(ablation: Ablation, measured: Mapping[str, Mapping[str, Any]]) -> None:
    """Check that each point has the main figure of all methods, which a place without recording lacks.

    Raises:
        ConfigError: one has not.
    """
    for files in measured.values():
        figures = one_of("entry", ablation.entry, files[ablation.metrics])
        for method in (*ablation.references, *ablation.methods):
            one_of("methods", method, figures)


@config_errors()
def main() -> None:
    """Run all points, write the figures."""
    parser = argparse.ArgumentParser(prog="python -m tools.ablate", description=__doc__.partition(":")[0])
    parser.add_argument("name", help="a file in conf/ablations, without .yaml")
    parser.add_argument("--jobs", type=count, default=1, help="points at a time")
    parser.add_argument("--point", action="append", help="run this point only; may be repeated")
    parser.add_argument("--out", type=Path, help="reports/ablations, with --point build/ablations")
    options = parser.parse_args()
    in_project(Path())
    ablation = read_ablation(Path("conf/ablations") / f"{options.name}.yaml")
    if options.point:
        points = {point: one_of("point", point, ablation.points) for point in options.point}
        ablation = replace(ablation, points=points)
    out = options.out or Path("build/ablations" if options.point else "reports/ablations")
    check_output(out, folder=True)
    open_project().close()
    check_points(ablation, Path("conf"))
    experiments = {point: f"{options.name}-{point.replace(' ', '-')}" for point in ablation.points}
    references = run_points(ablation, experiments, options.jobs)
    measured = metrics_of_points(ablation, references)
    check_measured(ablation, measured)
    rows = point_rows(ablation, measured)
    methods = Methods.read(Path(), read_params(Path()).comparison.reference)
    tables = [ablation_table(ablation, rows, methods)]
    if ablation.curves:
        tables.append(
            steps_table(ablation, steps_until(ablation, training_curves(ablation, references)), methods)
        )
    write_json(out / f"{options.name}.json", rows)
    write_text(out / f"{options.name}.md", "\n\n".join(tables) + "\n")
    write_png(ablation_figure(ablation, rows, methods), out / f"{options.name}.png")
    logging.getLogger(__name__).info("\n%s", "\n\n".join(tables))


if __name__ == "__main__":
    main()
