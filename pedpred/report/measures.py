"""Metric files, {test set: {method: {"ade_m": ..., ...}}}, and results made of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from pedpred.errors import StorageError, ValueRuleError
from pedpred.files import read_json, translate_errors

Figures = Mapping[str, Mapping[str, Any]]
"""The figures of each method in one test set, by the method's key."""

_QUARTILES = tuple(f"per_step_q{q}_m" for q in (25, 50, 75))
_FIELDS = ("ade_m", "ade_m_ci95", "windows", "tracks", "per_step_m", *_QUARTILES)


@dataclass(frozen=True)
class Result:
    """What was measured in one test set; `parts` are its single scenes by name, where it pools several."""

    name: str
    where: str  # kind of test set, "simulation" or "real"
    place: str  # the test set in words, with what its networks were trained on, as in "at home (...)"
    figures: Figures
    dt_s: float  # between two steps of the forecasts, s
    parts: Mapping[str, Figures] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """The place as a heading."""
        return self.place[0].upper() + self.place[1:]

    @property
    def noncausal(self) -> bool:
        """Whether these are figures of the protocol whose inputs know the future."""
        return any(own.get("noncausal") for own in self.figures.values())


def read_metrics(path: Path) -> dict[str, Figures]:
    """Read a metric file.

    Raises:
        StorageError: it is no JSON, or a method lacks a figure; the error names it.
    """
    wording = partial(StorageError, path, "file")
    sets = read_json(path, wording)
    with translate_errors(wording):
        for name, figures in sets.items():
            for method, own in figures.items():
                missing = [field for field in _FIELDS if field not in own]
                if missing:
                    raise StorageError(path, f"{name}/{method}/{missing[0]}", "it is missing")
    return sets


def results_of(
    metrics: Mapping[str, Figures], folds: Iterable[Mapping[str, Sequence[str]]], where: str, dt_s: float
) -> list[Result]:
    """The test sets of some folds (with `train` and `test`), in their order; see `Result` for the arguments.

    In the metrics, single scenes of a test set are named `<test set>_<scene>`.

    Raises:
        ValueRuleError: a test set has no figures.
    """
    found = []
    for fold in folds:
        tuned = f" (fine-tuned on {' and '.join(fold['train'])})" if fold["train"] else ""
        for name in fold["test"]:
            if name not in metrics:
                raise ValueRuleError("metrics", sorted(metrics), f"the test set {name!r} must be among them")
            place = "in simulated rooms that no training saw" if where == "simulation" else f"at {name}"
            parts = {k.removeprefix(f"{name}_"): v for k, v in metrics.items() if k.startswith(f"{name}_")}
            found.append(Result(name, where, place + tuned, metrics[name], dt_s, parts))
    return found
