"""Everything that reports are made of, read from the folders of the pipeline, and the pages in Markdown."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pedpred.errors import StorageError
from pedpred.forecasting import Methods
from pedpred.networks.autoencoder import read_autoencoder
from pedpred.report.curves import read_curve
from pedpred.report.document import Block, Section, Text
from pedpred.report.findings import Paper
from pedpred.report.gallery import Evaluated
from pedpred.report.measures import read_metrics, results_of
from pedpred.report.sections import READING, answer_section, expectations_section, parts_sections, warnings
from pedpred.storage.scenes import read_scenes
from pedpred.storage.windows import read_windows

KINDS = {"sim": ("simulated", "simulation"), "real": ("real", "real")}
"""Kinds of test sets by the names of their pages: their folder, and the value of a method's `where`."""
TITLES = {
    "simulation": "Simulation: rooms that no network was trained in",
    "real": "Real pedestrians: places that no network was trained on",
}


def gather(key: str, folds: Mapping[str, Any], root: Path = Path()) -> Evaluated:
    """Read metrics, scenes, forecasts and curves of one kind of test sets ("sim" or "real").

    Raises:
        StorageError: a file is missing or damaged.
        ValueRuleError: a test set has no metrics.
    """
    kind, where = KINDS[key]
    forecasts = sorted((root / "data/forecasts" / kind).glob("*/*.parquet"), key=lambda path: path.stem)
    if not forecasts:
        raise StorageError(root / "data/forecasts" / kind, "forecasts", "there are none")
    windows = {path.stem: read_windows(path) for path in forecasts}
    metrics = read_metrics(root / f"reports/metrics/{key}.json")
    dt_s = next(iter(windows.values())).dt_s
    results = results_of(metrics, folds[kind].values(), where, dt_s)
    tested, folder = [result.name for result in results], root / "data/scenes" / kind
    others = sorted({path.name for path in folder.iterdir() if path.is_dir()} - set(tested))
    scenes = {name: list(read_scenes(folder / name)) for name in [*tested, *others]}
    tables = sorted((root / "reports/curves" / key).glob("*.tsv"))
    curves = {table.stem: curve for table in tables if len(curve := read_curve(table))}  # not of copies
    return Evaluated(results, scenes, windows, curves, read_autoencoder(root / "models/autoencoder")[0])


def document(evaluated: Evaluated, pictures: list[Section], methods: Methods, paper: Paper) -> Section:
    """The page on one kind of test sets: answers, metrics, expectations and pictures."""
    results, where = evaluated.results, evaluated.where
    blocks: list[Block] = [*warnings(results)]
    blocks += [answer_section(result, methods, paper) for result in results]
    blocks += [Text(text) for text in (READING, paper.remarks.get(where, "")) if text]
    blocks += [expectations_section(results, methods, paper), *parts_sections(results, methods)]
    return Section(TITLES[where], [*blocks, *pictures])
