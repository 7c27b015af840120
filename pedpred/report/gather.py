"""Everything that reports are made of, read from the folders of the pipeline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from pedpred.errors import StorageError
from pedpred.files import read_json
from pedpred.forecasting import Methods
from pedpred.networks.autoencoder import GridAutoencoder, read_autoencoder
from pedpred.report.curves import read_curve
from pedpred.report.document import Block, Section, Text
from pedpred.report.findings import Paper
from pedpred.report.gallery import gallery
from pedpred.report.measures import Result, read_metrics, results_of
from pedpred.report.sections import (
    READING,
    answer_section,
    expectations_section,
    parts_sections,
    warnings,
)
from pedpred.scenes import Scene
from pedpred.storage.scenes import read_scenes
from pedpred.storage.windows import EvaluationWindows, read_windows

KINDS = {"sim": ("simulated", "simulation"), "real": ("real", "real")}
"""Kinds of test sets: their folder, and the value of a method's `where`."""
TITLES = {
    "sim": "Simulation: rooms that no network was trained in",
    "real": "Real pedestrians: places that no network was trained on",
}


@dataclass(frozen=True)
class Evaluated:
    """What was measured of one kind of test sets, and what it was measured on.

    Attributes:
        key: "sim" or "real".
        results: of the test sets.
        scenes: by data set; those that networks were trained in follow the test sets.
        windows: forecasts by scene.
        curves: of trainings, by name.
        autoencoder: that encodes obstacle grids.
    """

    key: str
    results: Sequence[Result]
    scenes: Mapping[str, Sequence[Scene]]
    windows: Mapping[str, EvaluationWindows]
    curves: Mapping[str, pd.DataFrame]
    autoencoder: GridAutoencoder

    def scene(self, name: str) -> Scene:
        """A scene by its name."""
        return next(scene for scenes in self.scenes.values() for scene in scenes if scene.name == name)

    def gallery(self, methods: Methods) -> list[Section]:
        """All pictures."""
        return gallery(self.results, self.scenes, self.windows, self.curves, self.autoencoder, methods)

    def document(self, methods: Methods, paper: Paper) -> Section:
        """The page: answer, metrics, expectations and pictures."""
        results = self.results
        answers = [answer_section(result, methods, paper) for result in results]
        where = results[0].where
        remarks: list[Block] = [Text(paper.remarks[where])] if where in paper.remarks else []
        expected = expectations_section(results, methods, paper)
        parts = parts_sections(results, methods)
        blocks: list[Block] = [*warnings(results), *answers, Text(READING), *remarks, expected, *parts]
        return Section(TITLES[self.key], [*blocks, *self.gallery(methods)])


def gather(key: str, folds: Mapping[str, Any], root: Path = Path()) -> Evaluated:
    """Read metrics, scenes, forecasts and curves of one kind of test sets, and the auto-encoder.

    Args:
        key: "sim" or "real".
        folds: rows with `train` and `test`, by kind.
        root: the project's folder.

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
    autoencoder, _ = read_autoencoder(root / "models/autoencoder")
    return Evaluated(key, results, scenes, windows, curves, autoencoder)


def read_figures(root: Path = Path()) -> dict[str, Any]:
    """Read all metric files of a project, by name."""
    found = sorted((root / "reports/metrics").glob("*.json"))
    return {path.stem: read_json(path, partial(StorageError, path, "file")) for path in found}
