"""Run an ablation of conf/ablations as DVC experiments: `python -m stages.ablate layouts [--jobs 2]`.

By hand, after `dvc repro`; the figures go to reports/ablations/<name>.{json,md,png}. Points run beside each
other in copies of their own; what has been computed before comes from DVC's cache, so an interrupted ablation
continues.
"""

from __future__ import annotations

import argparse
import json
import logging
import subprocess
from pathlib import Path

from joblib import Parallel, delayed
from tqdm import tqdm

from pedpred.files import write_json, write_text
from pedpred.report.ablation import Ablation, ablation_figure, ablation_table, point_rows, read_ablation
from pedpred.report.canvas import write_png


def reproduced(ablation: Ablation, name: str, point: str) -> dict:
    """Run one point as a DVC experiment; the measures of every method."""
    experiment = f"{name}-{point.replace(' ', '-')}"
    overrides = [f"--set-param={o}" for o in (*ablation.always, *ablation.points[point])]
    command = ["dvc", "exp", "run", "--temp", "--force", "--name", experiment, *overrides, ablation.target]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{experiment}: {done.stdout}\n{done.stderr}")
    pattern = f"refs/exps/*/*/{experiment}"
    found = subprocess.run(
        ["git", "for-each-ref", "--sort=-committerdate", "--format=%(refname)", pattern],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    text = subprocess.run(
        ["git", "show", f"{found[0]}:{ablation.metrics}"], capture_output=True, text=True, check=True
    )
    return json.loads(text.stdout)[ablation.entry]


def main() -> None:
    """Run all points, write the figures."""
    parser = argparse.ArgumentParser(description=__doc__.partition(":")[0])
    parser.add_argument("name", help="a file in conf/ablations, without .yaml")
    parser.add_argument("--jobs", type=int, default=1, help="points at a time")
    parser.add_argument("--out", type=Path, default=Path("reports/ablations"))
    options = parser.parse_args()
    ablation = read_ablation(Path("conf/ablations") / f"{options.name}.yaml")
    workers = Parallel(n_jobs=options.jobs, backend="threading", return_as="generator")
    done = workers(delayed(reproduced)(ablation, options.name, point) for point in ablation.points)
    measured = dict(zip(ablation.points, tqdm(done, total=len(ablation.points), unit="point"), strict=True))
    rows = point_rows(ablation, measured)
    write_json(options.out / f"{options.name}.json", rows)
    write_text(options.out / f"{options.name}.md", f"{ablation_table(ablation, rows)}\n")
    write_png(ablation_figure(ablation, rows), options.out / f"{options.name}.png")
    logging.getLogger(__name__).info("\n%s", ablation_table(ablation, rows))


if __name__ == "__main__":
    main()
