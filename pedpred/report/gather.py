"""Everything that reports are made of, read from the folders of the pipeline, and the pages in Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pandas as pd

from pedpred.errors import InputError, ValueRuleError
from pedpred.evaluation.forecasts import EvaluationWindows, read_forecasts
from pedpred.models.lstm.autoencoder import GridAutoencoder, read_autoencoder
from pedpred.report.document import Block, Section, Text
from pedpred.report.findings import Paper
from pedpred.report.methods import Methods
from pedpred.report.plots import read_curve
from pedpred.report.results import Result, read_metrics, results_of
from pedpred.report.sections import (
    READING,
    answer_section,
    expectations_section,
    paper_section,
    parts_sections,
    warnings,
)
from pedpred.scenes import Scene
from pedpred.storage.scenes import read_scenes

TITLES = {
    "sim": "Simulation: rooms that no network was trained in",
    "transfer": "Real pedestrians: networks trained in simulation only",
    "real": "Real pedestrians: places that no network was trained on",
}
"""Of studies; another one's name is its title."""
STAND_INS = "Simulated people in place of recordings: no network was trained on them"
"""Heading of studies of real pedestrians where there are none."""


@dataclass(frozen=True)
class Evaluated:
    """What was measured in a study, and what it was measured on."""

    study: str
    kind: str  # of its test sets, "simulated" or "real"
    results: Sequence[Result]
    scenes: Mapping[str, Sequence[Scene]]  # by data set; those of trainings follow the test sets
    windows: Mapping[str, EvaluationWindows]  # by scene
    curves: Mapping[str, pd.DataFrame]  # of trainings, by name
    autoencoder: GridAutoencoder
    missing: Mapping[str, str] = field(default_factory=dict)  # sets without recording: how to get it

    @property
    def stand_ins(self) -> dict[str, str]:
        """Tested scenes of simulated people in place of recorded ones, and how they were made."""
        tested = [scene for result in self.results for scene in self.scenes.get(result.name, ())]
        return {scene.name: scene.stand_in for scene in tested if scene.stand_in is not None}

    def scene(self, name: str) -> Scene:
        """Find a scene by its name."""
        return next(scene for scenes in self.scenes.values() for scene in scenes if scene.name == name)


def title_of(evaluated: Evaluated) -> str:
    """Return the heading of the page on a study."""
    return STAND_INS if evaluated.stand_ins else TITLES.get(evaluated.study, evaluated.study)


def gather(study: str, folds: Mapping[str, Mapping[str, Any]], root: Path = Path()) -> Evaluated:
    """Read metrics, scenes, forecasts and curves of a study.

    Args:
        study: its name.
        folds: of the study: sets that train and test.
        root: the project's folder.

    Raises:
        InputError: a file is missing or damaged.
        ValueRuleError: a test set has no metrics, or the study tests sets of several kinds.
    """
    tested = [entry.split("/") for fold in folds.values() for entry in fold["test"]]
    kinds, named = {kind for kind, _ in tested}, [name for _, name in tested]
    if len(kinds) != 1:
        raise ValueRuleError(f"folds.{study}", sorted(kinds), "a study tests sets of one kind")
    (kind,) = kinds
    folder = root / "data/scenes" / kind
    sets = {path.name: list(read_scenes(path)) for path in sorted(folder.iterdir()) if path.is_dir()}
    names = scene_names(named, sets)
    missing = {name: str(s[0].unavailable) for name, s in sets.items() if all(one.unavailable for one in s)}
    metrics = read_metrics(root / f"reports/metrics/{study}.json")
    windows: dict[str, EvaluationWindows] = {}
    for fold, entries in folds.items():
        for at in entries["test"]:
            name, networks = at.split("/")[1], fold if "train" in entries else "main"
            found = read_forecasts(root, networks, at, metrics.get(name, {}))
            windows |= {names.get((name, scene), scene): forecasts for scene, forecasts in found.items()}
    windows = dict(sorted(windows.items()))
    if not windows and any(name not in missing for name in named):
        raise InputError(root / "data/forecasts", "forecasts", f"there are none of the study {study}")
    dt_s = next((recorded.dt_s for recorded in windows.values()), 0.0)
    results = results_of(metrics, folds.values(), study, dt_s, [f"{kind}/{name}" for name in missing])
    sets = {
        name: [replace(scene, name=names.get((name, scene.name), scene.name)) for scene in scenes]
        for name, scenes in sets.items()
    }
    scenes = {name: sets[name] for name in [*(r.name for r in results), *sets] if name not in missing}
    tables = sorted((root / "reports/curves" / study).rglob("*.tsv"), key=lambda path: path.name)
    curves = {table.stem: curve for table in tables if len(curve := read_curve(table))}  # not of copies
    autoencoder = read_autoencoder(root / "models/autoencoder")
    return Evaluated(study, kind, results, scenes, windows, curves, autoencoder, missing)


def scene_names(tested: Sequence[str], sets: Mapping[str, Sequence[Scene]]) -> dict[tuple[str, str], str]:
    """Tell scenes of test sets apart: a name that an earlier set has follows that of its set.

    Args:
        tested: names of the test sets, in their order.
        sets: scenes by name of the set.

    Returns:
        (set, scene) -> name of the scene on the page.
    """
    names: dict[tuple[str, str], str] = {}
    for name in dict.fromkeys(tested):
        taken = set(names.values())
        for scene in sets.get(name, ()):
            names[name, scene.name] = f"{name}_{scene.name}" if scene.name in taken else scene.name
    return names


def study_page(evaluated: Evaluated, pictures: Sequence[Section], methods: Methods, paper: Paper) -> Section:
    """The page on a study: answers, metrics, expectations and pictures."""
    results = evaluated.results
    blocks: list[Block] = [*warnings(results, evaluated.missing, evaluated.stand_ins)]
    blocks += [*(answer_section(result, methods) for result in results), Text(READING)]
    blocks += [*paper_section(results, methods, paper), expectations_section(results, methods, paper)]
    return Section(title_of(evaluated), [*blocks, *parts_sections(results, methods), *pictures])
